// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <string_view>

namespace cles::protocol {

/// The length of the well-formed UTF-8 sequence (Unicode 15, table 3-7) that begins at `at`, or 0.
std::size_t utf8_sequence(std::string_view text, std::size_t at) noexcept;

bool is_utf8(std::string_view text) noexcept;

} // namespace cles::protocol
