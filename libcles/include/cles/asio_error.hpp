// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <boost/asio/error.hpp>

/// Comparisons of error codes with the values of Asio. `code == boost::asio::error::operation_aborted` also holds for
/// `cles::errc::cancelled`, and likewise for `timed_out` and the others that have the same error condition. Otherwise,
/// codes are equal only within one category. Codes of other categories than `cles::error_category()` compare as in
/// Boost.System.

namespace boost::asio::error {

inline bool operator==(const boost::system::error_code& code, basic_errors value) noexcept {
    const auto other = make_error_code(value);
    return code == other || (code.category() == cles::error_category() && code == other.default_error_condition());
}
inline bool operator==(basic_errors value, const boost::system::error_code& code) noexcept { return code == value; }
inline bool operator!=(const boost::system::error_code& code, basic_errors value) noexcept { return !(code == value); }
inline bool operator!=(basic_errors value, const boost::system::error_code& code) noexcept { return !(code == value); }

} // namespace boost::asio::error

namespace cles {

inline bool operator==(errc code, boost::asio::error::basic_errors value) noexcept {
    return make_error_code(code) == value;
}
inline bool operator==(boost::asio::error::basic_errors value, errc code) noexcept { return code == value; }

} // namespace cles
