// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_host.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

#include <string>

namespace cles::transport {
namespace asio = boost::asio;

asio::ip::address resolve(const url& where, boost::system::error_code& code) {
    const auto host = where.host == "localhost" ? std::string{"127.0.0.1"} : where.host;
    const auto address = asio::ip::make_address(host, code);
    if (!code) {
        return address;
    }
    asio::io_context lookup;
    asio::ip::tcp::resolver resolver{lookup}; // an address is the same for TCP and UDP
    const auto found = resolver.resolve(host, "", code);
    return code || found.empty() ? asio::ip::address{} : found.begin()->endpoint().address();
}

} // namespace cles::transport
