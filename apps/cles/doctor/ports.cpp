// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/identity.hpp>
#include <cles/url.hpp>

#include "client/client.hpp"
#include "discovery/host.hpp"
#include "doctor/checks.hpp"
#include "system/private_socket.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/address_v4.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/describe.hpp>

#include <chrono>
#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;

namespace {

constexpr auto port_timeout = 500ms;

struct listener {
    std::string node;
    std::string version;
};
BOOST_DESCRIBE_STRUCT(listener, (), (node, version))

/// The node that listens somewhere, or why it is not known.
struct listener_or_error : listener {
    std::string error;
    bool is_node = false; // even if it does not say which
    bool denied = false;  // by it: this key may not ask it
    bool refused = false; // at the beginning of the link: this key is no member for it
};

// Only a node answers with these. By datagram, the description of a node with many tasks exceeds the size of an answer.
bool is_error_of_node(boost::system::error_code code) {
    return code == cles::errc::too_large || code == cles::errc::denied || code == cles::errc::busy;
}

asio::awaitable<listener_or_error> identify(client& requester, cles::call_options options) {
    listener_or_error out;
    try {
        const auto answer = co_await requester.node().async_pull<listener>("self:cles", options);
        out.node = answer.node;
        out.version = answer.version;
        out.is_node = true;
    } catch (const cles::error& e) {
        out.is_node = is_error_of_node(e.code());
        out.denied = e.code() == cles::errc::denied;
        out.refused = e.code() == boost::system::errc::permission_denied &&
                      e.code().category() != cles::error_category() &&
                      e.code().category() != cles::untrusted_listener_category() && // this program's own refusal
                      e.code().category() != boost::system::system_category();
        out.error = e.message().empty() ? e.code().message() : e.message();
    }
    co_return out;
}

void report_node(const std::string& url, const listener_or_error& node, findings& found) {
    if (node.denied && url.starts_with("tls:")) {
        found.warning("ports", url + ": a node listens here, and denies it: " + node.error, advice_on_denial);
        return;
    }
    found.ok("ports", node.node.empty() ? url + ": a node listens here, and replies: " + node.error
                                        : url + ": the node " + node.node + " listens here, version " + node.version);
}

void report_refusal(const std::string& url, const std::string& error, findings& found) {
    found.failure("ports", url + ": a node listens here, and refuses this key: " + error,
                  "it is of another fleet, or its roster does not contain this key: compare what cles keys show prints "
                  "for its directory and for this one");
}

// What a node that wants to listen there would get.
template <class Protocol>
boost::system::error_code try_to_bind(asio::io_context& io) {
    boost::system::error_code code;
    typename Protocol::socket socket{io};
    open_private(socket, Protocol::v4(), code);
    if constexpr (std::same_as<Protocol, asio::ip::tcp>) {
        socket.set_option(asio::socket_base::reuse_address{true}, code); // as nodes do; it allows no second listener
    }
    socket.bind({asio::ip::address_v4::loopback(), cles::default_port}, code);
    return code;
}

asio::awaitable<std::string> check_default_port(client& requester, std::string_view protocol, findings& found) {
    const auto url = std::string{protocol} + "://127.0.0.1:" + std::to_string(cles::default_port);
    const auto code = protocol == "udp" ? try_to_bind<asio::ip::udp>(requester.context())
                                        : try_to_bind<asio::ip::tcp>(requester.context());
    if (!code) {
        found.ok("ports", url + " is free");
        co_return std::string{};
    }
    if (code != asio::error::address_in_use) {
        found.failure("ports", url + " is not available: " + code.message(),
                      "check that the interface lo is up: ip link set lo up");
        co_return std::string{};
    }
    cles::call_options options;
    options.at(url).deadline(port_timeout);
    const auto answer = co_await identify(requester, options);
    if (answer.is_node) {
        report_node(url, answer, found);
        co_return url;
    }
    if (answer.refused) {
        report_refusal(url, answer.error, found);
        co_return std::string{};
    }
    const auto process = process_listening_at(protocol == "udp" ? "udp" : "tcp", cles::default_port);
    if (process.starts_with("cles")) {
        found.warning("ports", url + ": " + process + " listens here, and refuses: " + answer.error,
                      "if it is a node with security, give the key of a member of its fleet: --keys DIR");
        co_return std::string{};
    }
    if (process.empty()) { // of another user, so it may be a node with security
        found.warning("ports", url + ": another program listens here, which does not reply as a node: " + answer.error,
                      "if it is a node with security, give the key of a member of its fleet: --keys DIR; otherwise let "
                      "nodes listen elsewhere: --listen of cles serve, listen in clesd.yaml");
        co_return std::string{};
    }
    found.failure("ports", url + ": " + process + " listens here, which is not a node: " + answer.error,
                  "stop it, or let nodes listen elsewhere: --listen of cles serve, listen in clesd.yaml");
    co_return std::string{};
}

asio::awaitable<void> check_given_address(client& requester, const address_book& addresses, findings& found) {
    const auto url = addresses.url_for("self");
    const auto options = requester.options_for("self:cles", port_timeout);
    const auto answer = co_await identify(requester, options);
    if (answer.is_node) {
        report_node(url, answer, found);
    } else if (answer.refused) {
        report_refusal(url, answer.error, found);
    } else {
        found.failure("ports", url + " does not reply: " + answer.error,
                      "start a node there (clesd, or cles serve --listen URL), or list the nodes: cles ls");
    }
}

} // namespace

asio::awaitable<std::string> check_ports(client& requester, const address_book& addresses, findings& found) {
    if (addresses.has_url()) {
        co_await check_given_address(requester, addresses, found);
        co_return std::string{};
    }
    if (addresses.is_secured()) {
        auto at = co_await check_default_port(requester, "tls", found);
        co_return at;
    }
    auto by_tcp = co_await check_default_port(requester, "tcp", found);
    auto by_udp = co_await check_default_port(requester, "udp", found);
    co_return by_tcp.empty() ? by_udp : by_tcp;
}

} // namespace tool
