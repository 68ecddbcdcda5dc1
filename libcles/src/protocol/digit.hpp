// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::protocol {

/// As the grammars of JSON and of the protocol have it: ASCII, whatever the locale.
constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

} // namespace cles::protocol
