// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <string_view>

namespace cles::protocol {

/// What a datagram holds at most, a message with its LF: enough for any network not to cut it up.
inline constexpr std::size_t datagram_bytes = 1200;

/// Whether what came in a datagram, its last LF taken off, is more than one line.
constexpr bool has_many_lines(std::string_view text) noexcept { return text.find('\n') != std::string_view::npos; }

} // namespace cles::protocol
