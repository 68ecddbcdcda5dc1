// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/system/error_code.hpp>

#include <type_traits>

namespace cles::transport {

/// Why a link was not opened, if not even the address of its host is known. What the system's resolver reports has
/// Asio's codes.
enum class lookup_errc {
    timed_out = 1, ///< the system has not answered in time
    no_thread,     ///< the system refuses a thread, which a lookup needs
    too_many,      ///< too many names are being looked up
    no_answer,     ///< none of several addresses has answered a datagram in time
};

/// The category of these codes; its name is "cles.lookup". What took too long equals `timed_out`.
const boost::system::error_category& lookup_category() noexcept;

inline boost::system::error_code make_error_code(lookup_errc e) noexcept {
    return {static_cast<int>(e), lookup_category()};
}

} // namespace cles::transport

template <>
struct boost::system::is_error_code_enum<cles::transport::lookup_errc> : std::true_type {};
