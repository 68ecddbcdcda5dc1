// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

#include <cstddef>
#include <string_view>

namespace cles::protocol {

/// Parses a datagram of a multicast group, which holds one request. False if it is not valid: too long, of several
/// lines, a reply, or malformed. Views are into the datagram.
bool parse_group_message(std::string_view datagram, request_line& out);

/// The maximum size of a datagram, its LF included: small enough that no network fragments it.
inline constexpr std::size_t datagram_bytes = 1200;

/// Whether the text of a datagram, without its last LF, has more than one line.
constexpr bool has_many_lines(std::string_view text) noexcept { return text.find('\n') != std::string_view::npos; }

} // namespace cles::protocol
