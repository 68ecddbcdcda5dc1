// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_host.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>

#include <string>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

std::optional<asio::ip::address> literal_address(const url& where) {
    error_code is_name;
    const auto address = asio::ip::make_address(where.host == "localhost" ? "127.0.0.1" : where.host, is_name);
    return is_name ? std::nullopt : std::optional{address};
}

std::vector<asio::ip::address> addresses_of(const asio::ip::tcp::resolver::results_type& found) {
    std::vector<asio::ip::address> addresses;
    for (const auto& each : found) {
        addresses.push_back(each.endpoint().address());
    }
    return addresses;
}

asio::ip::address resolve(const url& where, error_code& code) {
    code = {};
    if (const auto literal = literal_address(where)) {
        return *literal;
    }
    asio::io_context lookup;
    asio::ip::tcp::resolver resolver{lookup};
    const auto addresses = addresses_of(resolver.resolve(where.host, "", code));
    if (!code && addresses.empty()) {
        code = asio::error::host_not_found;
    }
    return code ? asio::ip::address{} : addresses.front();
}

} // namespace cles::transport
