// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include <boost/system/error_code.hpp>

#include <cerrno>

#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {

/// Has an open socket mark what it sends with the DSCP of its URL, if there is one (RFC 2474; RFC 3542 for IPv6).
template <class Socket>
void set_traffic_class(Socket& socket, const url& where, boost::system::error_code& code) {
    if (!where.dscp) {
        return;
    }
    const bool is_v6 = socket.local_endpoint(code).address().is_v6();
    if (code) {
        return;
    }
    constexpr int congestion_bits = 2; // beneath it, and not ours to set (RFC 3168)
    const int value = *where.dscp << congestion_bits;
    const int level = is_v6 ? IPPROTO_IPV6 : IPPROTO_IP;
    if (::setsockopt(socket.native_handle(), level, is_v6 ? IPV6_TCLASS : IP_TOS, &value, sizeof value) != 0) {
        code.assign(errno, boost::system::system_category());
    }
}

} // namespace cles::transport
