// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles::json_detail {

/// Why a text is not JSON.
struct json_error {
    enum class kind : std::uint8_t { none, expected, bad, too_deep };
    kind what = kind::none;
    std::string_view text{}; ///< what was expected, or what is bad; static
};

/// Skips one JSON value of any kind and the white space before it, validating all of it. `at` is then after the value,
/// or at the error.
json_error skip_json(std::string_view text, std::size_t& at, std::size_t max_depth);

} // namespace cles::json_detail

/// The tokens of JSON (RFC 8259, sections 6 and 7). The scanners start at `at` and leave it after the token, or return
/// what is wrong there; an empty result is success.

namespace cles::json_detail {

std::string_view scan_number(std::string_view text, std::size_t& at, bool& integral) noexcept;

/// Reads a number of the usual form, up to 15 digits and no exponent, exactly and quickly. False for any other, valid
/// or not; then `at` stays. Such a number is a quotient of two integers that a double holds exactly, so one division
/// rounds it correctly (Clinger 1990, "How to read floating point numbers accurately").
bool read_short_decimal(std::string_view text, std::size_t& at, double& out) noexcept;

/// `at` is the opening quote. `raw` is set to the text between the quotes, `escaped` to whether it has escapes.
std::string_view scan_string(std::string_view text, std::size_t& at, std::string_view& raw, bool& escaped) noexcept;

/// Decodes a scanned string. False if an escape is half of a surrogate pair.
bool unescape(std::string_view raw, std::string& out);

} // namespace cles::json_detail
