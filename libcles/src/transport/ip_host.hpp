// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/system/error_code.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::transport {

/// The address of a URL's host, where it is one or `localhost`. Nothing: it is a name that has to be looked up.
std::optional<boost::asio::ip::address> literal_address(const url& where);

/// What was found for a host, in the order in which the system prefers it.
std::vector<boost::asio::ip::address> addresses_of(const boost::asio::ip::tcp::resolver::results_type& found);

/// The first address of a URL's host: as it stands, or looked up, which waits for the system's resolver. Only for where
/// a service is to listen; to dial there is `host_lookup`.
boost::asio::ip::address resolve(const url& where, boost::system::error_code& code);

/// The URL of a socket's end.
template <class Endpoint>
url url_of(std::string_view scheme, const Endpoint& end) {
    return {.scheme = std::string{scheme}, .host = end.address().to_string(), .port = end.port(), .path = {}};
}

} // namespace cles::transport
