// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_host.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/system/system_error.hpp>

#include <cerrno>

#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

std::optional<asio::ip::address> literal_address(const url& where) {
    error_code is_name;
    const auto address = asio::ip::make_address(where.host == "localhost" ? "127.0.0.1" : where.host, is_name);
    return is_name ? std::nullopt : std::optional{address};
}

std::vector<asio::ip::address> look_up_now(const std::string& host, error_code& code) {
    asio::io_context lookup;
    asio::ip::tcp::resolver resolver{lookup}; // an address is the same for TCP and UDP
    std::vector<asio::ip::address> addresses;
    for (const auto& each : resolver.resolve(host, "", code)) {
        addresses.push_back(each.endpoint().address());
    }
    if (!code && addresses.empty()) {
        code = asio::error::host_not_found;
    }
    return addresses;
}

asio::ip::address resolve(const url& where) {
    if (const auto literal = literal_address(where)) {
        return *literal;
    }
    error_code code;
    const auto addresses = look_up_now(where.host, code);
    if (code) {
        throw boost::system::system_error{code};
    }
    return addresses.front();
}

bool is_beyond_loopback(const url& where) {
    try {
        return !resolve(where).is_loopback();
    } catch (const boost::system::system_error&) {
        return false;
    }
}

void set_traffic_class(int socket, const url& where, error_code& code) {
    if (!where.dscp) {
        return;
    }
    constexpr int congestion_bits = 2; // the lower bits, not ours to set (RFC 3168)
    const int value = *where.dscp << congestion_bits;
    int family = 0;
    socklen_t size = sizeof family;
    if (::getsockopt(socket, SOL_SOCKET, SO_DOMAIN, &family, &size) != 0 ||
        (family == AF_INET6 ? ::setsockopt(socket, IPPROTO_IPV6, IPV6_TCLASS, &value, sizeof value)
                            : ::setsockopt(socket, IPPROTO_IP, IP_TOS, &value, sizeof value)) != 0) {
        code.assign(errno, boost::system::system_category());
    }
}

} // namespace cles::transport
