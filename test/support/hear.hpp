// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/group_session.hpp"
#include "protocol/group_message.hpp"

#include <string_view>

namespace cles::test {

/// The session hears a datagram, as it comes from the network.
inline void hear(core::group_session& session, const core::group_source& from, std::string_view datagram,
                 time_point now) {
    protocol::request_line said;
    session.on_message(from, protocol::parse_group_message(datagram, said) ? &said : nullptr, now);
}

} // namespace cles::test
