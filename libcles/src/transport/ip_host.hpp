// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include <boost/asio/ip/address.hpp>
#include <boost/system/error_code.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace cles::transport {

/// All addresses of a URL's host, in the order in which the system prefers them: as it stands, or looked up, which
/// waits for the system's resolver. None only with an error.
std::vector<boost::asio::ip::address> resolve_all(const url& where, boost::system::error_code& code);
/// The first of them.
boost::asio::ip::address resolve(const url& where, boost::system::error_code& code);

/// The URL of a socket's end.
template <class Endpoint>
url url_of(std::string_view scheme, const Endpoint& end) {
    return {.scheme = std::string{scheme}, .host = end.address().to_string(), .port = end.port(), .path = {}};
}

} // namespace cles::transport
