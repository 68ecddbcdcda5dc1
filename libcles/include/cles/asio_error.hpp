// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <boost/asio/error.hpp>

/// `code == boost::asio::error::operation_aborted`, as programs on Asio ask, holds for `cles::errc::cancelled` too; so
/// do `timed_out` and the others that have the same error condition. Codes are otherwise equal only within one
/// category; these comparisons see to codes of `cles::error_category()`, and leave all others to Boost.System.

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
