// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/system/error_code.hpp>

#include <cerrno>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {

/// Marks what an open socket sends with the DSCP of its URL, if there is one (RFC 2474; RFC 3542 for IPv6).
template <class Socket>
void set_traffic_class(Socket& socket, const url& where, boost::system::error_code& code) {
    if (!where.dscp) {
        return;
    }
    const bool is_v6 = socket.local_endpoint(code).address().is_v6();
    if (code) {
        return;
    }
    constexpr int congestion_bits = 2; // the lower bits, not ours to set (RFC 3168)
    const int value = *where.dscp << congestion_bits;
    const int level = is_v6 ? IPPROTO_IPV6 : IPPROTO_IP;
    if (::setsockopt(socket.native_handle(), level, is_v6 ? IPV6_TCLASS : IP_TOS, &value, sizeof value) != 0) {
        code.assign(errno, boost::system::system_category());
    }
}

/// Looks up a host's addresses without blocking, on the resolver thread that Asio has for each execution context. The
/// first name that is looked up starts it; addresses never do.
class host_lookup : public std::enable_shared_from_this<host_lookup> {
  public:
    /// All addresses, in the system's order of preference; empty only with an error.
    using callback = std::function<void(boost::system::error_code, const std::vector<boost::asio::ip::address>&)>;

    explicit host_lookup(const boost::asio::any_io_executor& executor) : resolver_(executor), timeout_(executor) {}

    /// The callback is called once, and never from inside the call: with `timed_out` after `within`, however long the
    /// system takes.
    void start(const url& where, std::chrono::milliseconds within, callback done);
    /// The callback is not called any more.
    void give_up();

  private:
    void end(boost::system::error_code code, const std::vector<boost::asio::ip::address>& found);

    boost::asio::ip::tcp::resolver resolver_; // an address is the same for TCP and UDP
    boost::asio::steady_timer timeout_;
    callback done_;
};

/// The address of a URL's host if it is an address or `localhost`. Nothing: it is a name that has to be looked up.
std::optional<boost::asio::ip::address> literal_address(const url& where);

/// The addresses found for a host, in the system's order of preference.
std::vector<boost::asio::ip::address> addresses_of(const boost::asio::ip::tcp::resolver::results_type& found);

/// The first address of a URL's host; a name is looked up, which blocks. Only for listening; use `host_lookup` to dial.
boost::asio::ip::address resolve(const url& where, boost::system::error_code& code);

/// The URL of a socket's endpoint.
template <class Endpoint>
url url_of(std::string_view scheme, const Endpoint& end) {
    return {.scheme = std::string{scheme}, .host = end.address().to_string(), .port = end.port(), .path = {}};
}

} // namespace cles::transport
