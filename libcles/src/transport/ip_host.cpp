// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_host.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

#include <string>

namespace cles::transport {
namespace asio = boost::asio;

std::vector<asio::ip::address> resolve_all(const url& where, boost::system::error_code& code) {
    const auto host = where.host == "localhost" ? std::string{"127.0.0.1"} : where.host;
    const auto address = asio::ip::make_address(host, code);
    if (!code) {
        return {address};
    }
    asio::io_context lookup;
    asio::ip::tcp::resolver resolver{lookup}; // an address is the same for TCP and UDP
    const auto found = resolver.resolve(host, "", code);
    std::vector<asio::ip::address> addresses;
    for (const auto& each : found) {
        addresses.push_back(each.endpoint().address());
    }
    if (!code && addresses.empty()) {
        code = asio::error::host_not_found;
    }
    return addresses;
}

asio::ip::address resolve(const url& where, boost::system::error_code& code) {
    const auto all = resolve_all(where, code);
    return code ? asio::ip::address{} : all.front();
}

} // namespace cles::transport
