// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/url.hpp>

#include "client/client.hpp"
#include "discovery/sockets.hpp"
#include "doctor/checks.hpp"

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

constexpr auto port_patience = 500ms;

struct listener {
    std::string node;
    std::string version;
};
BOOST_DESCRIBE_STRUCT(listener, (), (node, version))

/// Who is there; where nobody says so, why.
struct listener_or_error : listener {
    std::string error;
    bool is_node = false; // it is one, though it does not say which
};

// Only a node answers so. By datagram, one that offers much has more to say of itself than an answer can hold.
bool is_said_by_a_node(boost::system::error_code code) {
    return code == cles::errc::too_large || code == cles::errc::denied || code == cles::errc::busy;
}

asio::awaitable<listener_or_error> ask(client& asker, cles::call_options options) {
    listener_or_error out;
    try {
        const auto there = co_await asker.node().async_pull<listener>("self:cles", options);
        out.node = there.node;
        out.version = there.version;
        out.is_node = true;
    } catch (const cles::error& e) {
        out.is_node = is_said_by_a_node(e.code());
        out.error = e.message().empty() ? e.code().message() : e.message();
    }
    co_return out;
}

finding is_there(const std::string& url, const listener_or_error& who) {
    return {"ports", verdict::ok,
            who.node.empty() ? url + ": a node is there, which answers: " + who.error
                             : url + ": the node " + who.node + " is there, version " + who.version};
}

// What a node that wants to listen there would be told.
template <class Protocol>
boost::system::error_code try_to_bind(asio::io_context& io, std::uint16_t port) {
    boost::system::error_code code;
    typename Protocol::socket socket{io};
    socket.open(Protocol::v4(), code);
    if constexpr (std::same_as<Protocol, asio::ip::tcp>) {
        socket.set_option(asio::socket_base::reuse_address{true}, code); // as nodes do; it shares with no listener
    }
    socket.bind({asio::ip::address_v4::loopback(), port}, code);
    return code;
}

finding taken(const std::string& url, std::string_view protocol, const std::string& why) {
    const auto holder = holder_of(protocol, cles::default_port);
    return {"ports", verdict::failure,
            url + ": " + (holder.empty() ? "another program" : holder) + " is there, and it is no node: " + why,
            "stop it, or let nodes listen elsewhere: --listen of cles serve, listen in clesd.yaml"};
}

asio::awaitable<void> check_usual(client& asker, std::string_view protocol, findings& found) {
    const auto url = std::string{protocol} + "://127.0.0.1:" + std::to_string(cles::default_port);
    const auto code = protocol == "tcp" ? try_to_bind<asio::ip::tcp>(asker.context(), cles::default_port)
                                        : try_to_bind<asio::ip::udp>(asker.context(), cles::default_port);
    if (!code) {
        found.push_back({"ports", verdict::ok, url + " is free"});
        co_return;
    }
    if (code != asio::error::address_in_use) {
        found.push_back({"ports", verdict::failure, url + " cannot be had: " + code.message(),
                         "is the interface lo up? ip link set lo up"});
        co_return;
    }
    cles::call_options options;
    options.at(url).deadline(port_patience);
    const auto answer = co_await ask(asker, options);
    found.push_back(answer.is_node ? is_there(url, answer) : taken(url, protocol, answer.error));
}

asio::awaitable<void> check_named(client& asker, const address_book& addresses, findings& found) {
    const auto url = addresses.url_for("self");
    const auto options = asker.options_for("self:cles", port_patience);
    const auto answer = co_await ask(asker, options);
    if (answer.is_node) {
        found.push_back(is_there(url, answer));
    } else {
        found.push_back({"ports", verdict::failure, url + " does not answer: " + answer.error,
                         "start a node there (clesd, or cles serve --listen URL), or see who is there: cles ls"});
    }
}

} // namespace

asio::awaitable<void> check_ports(client& asker, const address_book& addresses, findings& found) {
    if (addresses.has_url()) {
        co_await check_named(asker, addresses, found);
        co_return;
    }
    co_await check_usual(asker, "tcp", found);
    co_await check_usual(asker, "udp", found);
}

} // namespace tool
