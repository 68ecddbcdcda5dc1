// SPDX-License-Identifier: BSL-1.0
#include "discovery/host.hpp"
#include "doctor/checks.hpp"
#include "system/private_socket.hpp"

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

/// A socket that listens at the port of the group, and one that sends, as nodes have them.
class group_probe {
  public:
    /// \throws boost::system::system_error, and `step` is what could not be done
    group_probe(const cles::multicast_options& options, const std::string& interface, std::string& step)
        : group_(asio::ip::make_address_v4(options.group), options.port) {
        const auto all = network_interfaces();
        const auto* used = find_interface(all, interface);
        const auto address = used == nullptr || used->address.empty() ? asio::ip::address_v4{}
                                                                      : asio::ip::make_address_v4(used->address);
        ip_mreqn membership{};
        membership.imr_multiaddr.s_addr = htonl(group_.address().to_v4().to_uint());
        membership.imr_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));

        open_private(listener_, udp::v4());
        open_private(sender_, udp::v4());
        listener_.set_option(asio::socket_base::reuse_address{true});
        step = "listen at udp port " + std::to_string(options.port);
        listener_.bind(group_);
        step = "join the group " + options.group + " on " + interface;
        set(listener_, IP_ADD_MEMBERSHIP, membership);
        step = "send from " + interface;
        sender_.bind({address, 0});
        set(sender_, IP_MULTICAST_IF, membership);
        sender_.set_option(asio::ip::multicast::enable_loopback{true});
    }

    void send() {
        // Nodes that receive it announce their addresses, as for any node that starts.
        static constexpr std::string_view request = "BIND all:cles\n";
        sender_.send_to(asio::buffer(request), group_);
    }

    /// Whether the datagram that was sent is received in time.
    bool receives_own(std::chrono::milliseconds limit) {
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
    udp::socket listener_{io_};
    udp::socket sender_{io_};
};

std::string advice_on(const boost::system::error_code& code, const cles::multicast_options& group,
                      const std::string& interface) {
    if (code == asio::error::address_in_use) {
        const auto holder = process_listening_at("udp", group.port);
        return "stop " + (holder.empty() ? "the program" : holder) +
               ", which uses the port exclusively, or choose another port: IFACE,GROUP:PORT on all nodes";
    }
    if (code == asio::error::no_permission || code == asio::error::access_denied) {
        return "a firewall or a sandbox blocks it: allow udp to " + group.group + ":" + std::to_string(group.port);
    }
    return "check that " + interface +
           " is up, and that its network supports multicast; cles ls --at URL and seeds work "
           "without it";
}

bool check_group(const cles::multicast_options& group, const std::string& interface, findings& found) {
    const auto address = group.group + ":" + std::to_string(group.port);
    const auto all = network_interfaces();
    if (const auto* const used = find_interface(all, interface); used != nullptr && used->address.empty()) {
        found.failure("multicast", "nodes cannot use " + interface + ", which has no IPv4 address", "assign one");
        return false;
    }
    std::string step;
    try {
        group_probe probe{group, interface, step};
        probe.send();
        if (probe.receives_own(1s)) {
            found.ok("multicast", "datagrams to " + address + " on " + interface + " are received");
            return true;
        }
        found.failure("multicast", "datagrams from this host to " + address + " on " + interface + " are not received",
                      "a firewall drops them: allow udp from any port to " + address);
    } catch (const boost::system::system_error& e) {
        found.failure("multicast", "this host cannot " + step + ": " + e.code().message(),
                      advice_on(e.code(), group, interface));
    }
    return false;
}

} // namespace

std::vector<std::string> check_multicast(const cles::multicast_options& group, findings& found) {
    if (!group.is_on()) {
        found.ok("multicast", "is off: nodes are found by --at, --peer and seeds");
    }
    auto interfaces = cles::interfaces_of(group);
    std::erase_if(interfaces, [&](const std::string& each) { return !check_group(group, each, found); });
    return interfaces;
}

} // namespace tool
