// SPDX-License-Identifier: BSL-1.0
// Both ends of a TCP link detect within `limits::stall` that the peer's host has failed: the system sends keepalive
// probes.

#include <cles/link.hpp>

#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <ostream>
#include <vector>

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace lost_peer {
namespace {

namespace asio = boost::asio;
using cles::test::run_until;
using namespace std::chrono_literals;

constexpr int descriptors = 1024;

/// How the system checks whether the peer of a socket is alive.
struct watching {
    int keepalive = -1;
    int idle_s = -1;
    int interval_s = -1;
    int probes = -1;
    int user_timeout_ms = -1;

    bool operator==(const watching&) const = default;
    friend std::ostream& operator<<(std::ostream& out, const watching& w) {
        return out << "keepalive " << w.keepalive << " after " << w.idle_s << " s, " << w.probes << " times every "
                   << w.interval_s << " s; user timeout " << w.user_timeout_ms << " ms";
    }
};

int option(int fd, int level, int name) {
    int value = -1;
    socklen_t length = sizeof value;
    ::getsockopt(fd, level, name, &value, &length);
    return value;
}

/// For each connected socket of this process that has this port on either side.
std::vector<watching> connected_at(std::uint16_t port) {
    std::vector<watching> found;
    for (int fd = 0; fd < descriptors; ++fd) {
        sockaddr_in own{};
        sockaddr_in peer{};
        socklen_t length = sizeof own;
        if (::getsockname(fd, reinterpret_cast<sockaddr*>(&own), &length) != 0 || own.sin_family != AF_INET) {
            continue;
        }
        length = sizeof peer;
        if (::getpeername(fd, reinterpret_cast<sockaddr*>(&peer), &length) == 0 &&
            (ntohs(own.sin_port) == port || ntohs(peer.sin_port) == port)) {
            found.push_back({.keepalive = option(fd, SOL_SOCKET, SO_KEEPALIVE),
                             .idle_s = option(fd, IPPROTO_TCP, TCP_KEEPIDLE),
                             .interval_s = option(fd, IPPROTO_TCP, TCP_KEEPINTVL),
                             .probes = option(fd, IPPROTO_TCP, TCP_KEEPCNT),
                             .user_timeout_ms = option(fd, IPPROTO_TCP, TCP_USER_TIMEOUT)});
        }
    }
    return found;
}

/// Both ends of a link.
std::vector<watching> ends_of_link(std::chrono::milliseconds stall) {
    asio::io_context io;
    cles::limits bounds;
    bounds.stall = stall;
    auto* tcp = cles::find_transport("tcp");
    const auto acceptor = tcp->listen(io.get_executor(), cles::parse_url("tcp://127.0.0.1:0"), bounds);
    cles::link_ptr far;
    cles::link_ptr near;
    acceptor->start([&](cles::link_ptr made) { far = std::move(made); });
    tcp->dial(io.get_executor(), acceptor->local(), bounds, [&](boost::system::error_code code, cles::link_ptr made) {
        BOOST_TEST(!code);
        near = std::move(made);
    });
    run_until(io, [&] { return far && near; });
    auto found = connected_at(acceptor->local().port);
    for (const auto& each : {far, near}) {
        each->close();
    }
    acceptor->close();
    return found;
}

} // namespace
} // namespace lost_peer

BOOST_AUTO_TEST_SUITE(lost_peer)

BOOST_AUTO_TEST_CASE(the_system_looks_for_it_at_both_ends_and_gives_up_when_the_link_would) {
    const watching each{.keepalive = 1, .idle_s = 6, .interval_s = 2, .probes = 3, .user_timeout_ms = 12'000};
    BOOST_TEST(ends_of_link(12s) == (std::vector{each, each}), boost::test_tools::per_element());
    const auto usual = ends_of_link(cles::limits{}.stall);
    BOOST_REQUIRE_EQUAL(usual.size(), 2U);
    for (const auto& end : usual) {
        BOOST_TEST(end.keepalive == 1);
        const std::chrono::seconds silent{end.idle_s + end.interval_s * end.probes};
        BOOST_CHECK(silent <= cles::limits{}.stall);
        BOOST_CHECK(std::chrono::milliseconds{end.user_timeout_ms} == cles::limits{}.stall);
    }
}

BOOST_AUTO_TEST_CASE(the_system_accepts_any_limit) {
    const watching least{.keepalive = 1, .idle_s = 3, .interval_s = 1, .probes = 3, .user_timeout_ms = 6'000};
    BOOST_TEST(ends_of_link(1ms) == (std::vector{least, least}), boost::test_tools::per_element());
    const watching most{.keepalive = 1, .idle_s = 1800, .interval_s = 600, .probes = 3, .user_timeout_ms = 3'600'000};
    BOOST_TEST(ends_of_link(std::chrono::milliseconds::max()) == (std::vector{most, most}),
               boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
