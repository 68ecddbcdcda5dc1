// SPDX-License-Identifier: BSL-1.0
#include "discovery/network_interfaces.hpp"
#include "discovery/sockets.hpp"
#include "doctor/checks.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/address_v4.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/system/system_error.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <string>
#include <string_view>

#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using asio::ip::udp;
using steady = std::chrono::steady_clock;

namespace {

/// A listener at the group's port, and a sender of its own, as nodes have them.
class group_probe {
  public:
    /// \throws boost::system::system_error, and then `step` says what could not be done
    group_probe(const cles::multicast_options& where, const std::string& interface, std::string& step)
        : group_(asio::ip::make_address_v4(where.group), where.port) {
        const auto all = interfaces_of_host();
        const auto by =
            std::find_if(all.begin(), all.end(), [&](const net_interface& i) { return i.name == interface; });
        const auto address =
            by == all.end() || by->address.empty() ? asio::ip::address_v4{} : asio::ip::make_address_v4(by->address);
        ip_mreqn membership{};
        membership.imr_multiaddr.s_addr = htonl(group_.address().to_v4().to_uint());
        membership.imr_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));

        listener_.set_option(asio::socket_base::reuse_address{true});
        step = "listen to udp port " + std::to_string(where.port);
        listener_.bind(group_);
        step = "join the group " + where.group + " on " + interface;
        set(listener_, IP_ADD_MEMBERSHIP, membership);
        step = "send from " + interface;
        sender_.bind({address, 0});
        set(sender_, IP_MULTICAST_IF, membership);
        sender_.set_option(asio::ip::multicast::enable_loopback{true});
    }

    void send() {
        // Nodes that receive it announce where they are, as for any node that starts.
        static constexpr std::string_view word = "BIND all:cles\n";
        sender_.send_to(asio::buffer(word), group_);
    }

    /// Whether the own word comes back in time.
    bool hears_itself(std::chrono::milliseconds limit) {
        const auto until = steady::now() + limit;
        const auto own = sender_.local_endpoint();
        std::array<char, 2048> text{};
        for (;;) {
            const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - steady::now());
            pollfd ready{listener_.native_handle(), POLLIN, 0};
            if (left < 0ms || ::poll(&ready, 1, static_cast<int>(left.count())) != 1) {
                return false;
            }
            udp::endpoint from;
            boost::system::error_code code;
            listener_.receive_from(asio::buffer(text), from, 0, code);
            if (!code && from == own) {
                return true;
            }
        }
    }

  private:
    template <class T>
    static void set(udp::socket& socket, int option, const T& value) {
        if (::setsockopt(socket.native_handle(), IPPROTO_IP, option, &value, sizeof value) != 0) {
            throw boost::system::system_error{errno, boost::system::system_category()};
        }
    }

    asio::io_context io_;
    udp::endpoint group_;
    udp::socket listener_{io_, udp::v4()};
    udp::socket sender_{io_, udp::v4()};
};

std::string advice_for(const boost::system::error_code& code, const cles::multicast_options& where,
                       const std::string& interface) {
    if (code == asio::error::address_in_use) {
        const auto holder = holder_of("udp", where.port);
        return "stop " + (holder.empty() ? "the program" : holder) +
               " that keeps the port to itself, or choose another: IFACE,GROUP:PORT on all nodes";
    }
    if (code == asio::error::no_permission || code == asio::error::access_denied) {
        return "a firewall or a sandbox forbids it: allow udp to " + where.group + ":" + std::to_string(where.port);
    }
    return "is " + interface + " up, and does its network carry multicast? cles ls --at URL and seeds need none";
}

bool is_heard(const cles::multicast_options& where, const std::string& interface, findings& found) {
    const auto group = where.group + ":" + std::to_string(where.port) + " on " + interface;
    std::string step;
    try {
        group_probe probe{where, interface, step};
        probe.send();
        if (probe.hears_itself(1s)) {
            found.push_back({"multicast", verdict::ok, "what is sent to " + group + " is heard"});
            return true;
        }
        found.push_back(
            {"multicast", verdict::failure, "what this host sends to " + group + " does not come back to it",
             "a firewall drops it: allow udp from any port to " + where.group + ":" + std::to_string(where.port)});
    } catch (const boost::system::system_error& e) {
        found.push_back({"multicast", verdict::failure, "this host cannot " + step + ": " + e.code().message(),
                         advice_for(e.code(), where, interface)});
    }
    return false;
}

} // namespace

std::vector<std::string> check_multicast(const cles::multicast_options& where, findings& found) {
    if (!where.is_on()) {
        found.push_back({"multicast", verdict::ok, "is off: nodes are found by --at, --peer and seeds"});
    }
    auto interfaces = cles::interfaces_of(where);
    std::erase_if(interfaces, [&](const std::string& each) { return !is_heard(where, each, found); });
    return interfaces;
}

} // namespace tool
