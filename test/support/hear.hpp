// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/publish/group_session.hpp"
#include "protocol/request_line.hpp"

#include <string_view>

namespace cles::test {

/// The session receives a datagram, as from the network.
inline void hear(core::group_session& session, const core::group_source& from, std::string_view datagram) {
    protocol::request_line said;
    const bool valid = protocol::parse_group_message(datagram, said);
    session.on_datagram({.from = from, .text = datagram, .request = valid ? &said : nullptr});
}

} // namespace cles::test
