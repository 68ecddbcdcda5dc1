// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_host.hpp"

#include "transport/member_handler.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/system/system_error.hpp>

#include <cerrno>
#include <utility>

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

namespace {

std::vector<asio::ip::address> addresses_of(const asio::ip::tcp::resolver::results_type& found) {
    std::vector<asio::ip::address> addresses;
    for (const auto& each : found) {
        addresses.push_back(each.endpoint().address());
    }
    return addresses;
}

} // namespace

asio::ip::address resolve(const url& where) {
    if (const auto literal = literal_address(where)) {
        return *literal;
    }
    asio::io_context lookup;
    asio::ip::tcp::resolver resolver{lookup};
    error_code code;
    const auto addresses = addresses_of(resolver.resolve(where.host, "", code));
    if (!code && addresses.empty()) {
        code = asio::error::host_not_found;
    }
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

void host_lookup::start(const url& where, std::chrono::milliseconds within, callback done) {
    done_ = std::move(done);
    if (const auto literal = literal_address(where)) {
        asio::post(resolver_.get_executor(),
                   [self = shared_from_this(), address = *literal] { self->end({}, {address}); });
        return;
    }
    timeout_.expires_after(within);
    wait_call<&host_lookup::on_timeout>(timeout_, shared_from_this());
    resolver_.async_resolve(where.host, "",
                            [self = shared_from_this()](error_code code, asio::ip::tcp::resolver::results_type found) {
                                self->end(code, addresses_of(found));
                            });
}

void host_lookup::on_timeout(error_code code) {
    if (!code) {
        end(asio::error::timed_out, {});
    }
}

void host_lookup::end(error_code code, const std::vector<asio::ip::address>& found) {
    const auto done = std::move(done_);
    give_up();
    if (done) {
        done(!code && found.empty() ? asio::error::host_not_found : code, found);
    }
}

void host_lookup::give_up() {
    done_ = nullptr;
    resolver_.cancel();
    timeout_.cancel();
}

} // namespace cles::transport
