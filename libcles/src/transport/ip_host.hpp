// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/url.hpp>

#include <boost/asio/ip/address.hpp>
#include <boost/system/error_code.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::transport {

/// Marks what an open socket sends with the DSCP of its URL, if there is one (RFC 2474; RFC 3542 for IPv6).
void set_traffic_class(int socket, const url& where, boost::system::error_code& code);

/// The address of a URL's host if it is an address or `localhost`. Nothing: it is a name that has to be looked up.
std::optional<boost::asio::ip::address> literal_address(const url& where);

/// The addresses of a host's name, in the system's order of preference; empty only with an error. Blocks, perhaps for
/// many seconds.
std::vector<boost::asio::ip::address> look_up_now(const std::string& host, boost::system::error_code& code);

/// The first address of a URL's host; a name is looked up, which blocks. Only for listening; use `host_lookup` to dial.
/// \throws boost::system::system_error
boost::asio::ip::address resolve(const url& where);

/// Whether a listener on this URL is reachable from other hosts. Without an address it is not: listening fails anyway.
bool is_beyond_loopback(const url& where);

/// The URL of a socket's endpoint.
template <class Endpoint>
url url_of(std::string_view scheme, const Endpoint& end) {
    return {.scheme = std::string{scheme}, .host = end.address().to_string(), .port = end.port(), .path = {}};
}

/// The identity of the peer at an endpoint.
template <class Endpoint>
identity identity_at(std::string_view scheme, const Endpoint& end) {
    return {.transport = std::string{scheme},
            .address = to_string(url_of(scheme, end)),
            .name = {},
            .uid = {},
            .local = end.address().is_loopback()};
}

} // namespace cles::transport
