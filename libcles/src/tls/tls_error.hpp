// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/system/error_code.hpp>

#include <type_traits>

namespace cles::tls {

/// Why a link with TLS, or by sealed datagrams, was not opened, or ended.
enum class tls_errc {
    failed = 1,      ///< unspecified; most failures have OpenSSL's code instead
    other_protocol,  ///< the other end does not speak `cles/1`
    too_many_keys,   ///< the other end changes its keys too often
    not_member,      ///< its key is not in the roster
    other_name,      ///< it is another member than expected
    refused_by_peer, ///< it refuses this node
    bad_admission,   ///< it sent something else before its welcome
    busy,            ///< too many links are being admitted
    removed,         ///< a member was removed from the roster
    needs_name,      ///< datagrams are sealed for a member, and none was named
    unknown_name,    ///< no member has that name
};

/// The category of these codes and of OpenSSL's; its name is "cles.tls". What the roster forbids equals
/// `permission_denied`.
const boost::system::error_category& tls_category() noexcept;

inline boost::system::error_code make_error_code(tls_errc e) noexcept { return {static_cast<int>(e), tls_category()}; }

/// OpenSSL's oldest error on this thread, which has to be one of the last call; `failed` if there is none.
boost::system::error_code take_openssl_error() noexcept;

} // namespace cles::tls

template <>
struct boost::system::is_error_code_enum<cles::tls::tls_errc> : std::true_type {};
