// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

/// The tokens of JSON (RFC 8259, sections 6 and 7). The scanners begin at `at`, leave it behind the token, or say what
/// is wrong there; an empty answer is success.

namespace cles::protocol {

std::string_view scan_number(std::string_view text, std::size_t& at, bool& integral) noexcept;

/// Reads a number of the form that most have, up to 15 digits and no exponent, exactly and quickly. False for any
/// other, right or wrong, and `at` then stays. Such a number is a quotient of two integers that a double holds exactly,
/// so that one division rounds it as it has to be (Clinger 1990, "How to read floating point numbers accurately").
bool read_short_decimal(std::string_view text, std::size_t& at, double& out) noexcept;

/// `at` is the opening quote. `raw` is what stands between the quotes, `escaped` whether it holds escapes.
std::string_view scan_string(std::string_view text, std::size_t& at, std::string_view& raw, bool& escaped) noexcept;

/// What a scanned string stands for. False where an escape is half of a surrogate pair.
bool unescape(std::string_view raw, std::string& out);

} // namespace cles::protocol
