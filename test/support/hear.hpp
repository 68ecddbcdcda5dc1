// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/publish/group_session.hpp"
#include "protocol/datagram.hpp"

#include <string_view>

namespace cles::test {

/// The session receives a datagram, as from the network.
inline void hear(core::group_session& session, const core::group_source& from, std::string_view datagram,
                 time_point now) {
    protocol::request_line said;
    session.on_message(from, protocol::parse_group_message(datagram, said) ? &said : nullptr, now);
}

} // namespace cles::test
