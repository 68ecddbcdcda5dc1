// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

#include <string_view>

namespace cles::protocol {

/// Reads a datagram of a multicast group, which has room for one request. False where it is none: too long, of several
/// lines, a reply, or malformed. Views are into the datagram.
bool parse_group_message(std::string_view datagram, request_line& out);

} // namespace cles::protocol
