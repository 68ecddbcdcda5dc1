// SPDX-License-Identifier: BSL-1.0
// A URL's DSCP marks what is sent on the link (docs/links.md).

#include <cles/link.hpp>

#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>

namespace traffic_class {
namespace {

namespace asio = boost::asio;
using cles::test::run_until;

constexpr int expedited = 46; // RFC 3246
constexpr int descriptors = 1024;

/// The traffic class of each socket of this process that is bound to a port or connected to it.
std::vector<int> classes_at(std::uint16_t port) {
    std::vector<int> found;
    for (int fd = 0; fd < descriptors; ++fd) {
        const auto has_port = [&](auto name_of) {
            sockaddr_in address{};
            socklen_t length = sizeof address;
            return name_of(fd, reinterpret_cast<sockaddr*>(&address), &length) == 0 && address.sin_family == AF_INET &&
                   ntohs(address.sin_port) == port;
        };
        if (has_port(::getsockname) || has_port(::getpeername)) {
            int value = -1;
            socklen_t length = sizeof value;
            if (::getsockopt(fd, IPPROTO_IP, IP_TOS, &value, &length) == 0) {
                found.push_back(value);
            }
        }
    }
    return found;
}

/// Links to a listener, both with their own DSCP.
std::vector<int> classes_of(const std::string& scheme, const std::string& listening, const std::string& dialled) {
    asio::io_context io;
    auto* carrier = cles::find_transport(scheme);
    const auto acceptor =
        carrier->listen(io.get_executor(), cles::parse_url(scheme + "://127.0.0.1:0" + listening), {});
    cles::link_ptr far;
    cles::link_ptr near;
    acceptor->start([&](cles::link_ptr made) { far = std::move(made); });
    auto where = acceptor->local();
    where.dscp = cles::parse_url(scheme + "://127.0.0.1" + dialled).dscp;
    carrier->dial(io.get_executor(), where, {}, [&](boost::system::error_code code, cles::link_ptr made) {
        BOOST_TEST(!code);
        near = std::move(made);
        near->output().append("hello\n");
        near->flush();
    });
    run_until(io, [&] { return far && near; });
    auto found = classes_at(where.port);
    for (const auto& each : {far, near}) {
        each->close();
    }
    acceptor->close();
    std::sort(found.begin(), found.end());
    return found;
}

} // namespace
} // namespace traffic_class

BOOST_AUTO_TEST_SUITE(traffic_class)

BOOST_AUTO_TEST_CASE(each_end_of_a_tcp_link_marks_what_it_sends) {
    BOOST_TEST(classes_of("tcp", "", "?dscp=46") == (std::vector<int>{0, 0, expedited << 2}),
               boost::test_tools::per_element());
    BOOST_TEST(classes_of("tcp", "?dscp=8", "?dscp=46") == (std::vector<int>{0, 8 << 2, expedited << 2}),
               boost::test_tools::per_element()); // the listener sends nothing
}

BOOST_AUTO_TEST_CASE(each_end_of_a_udp_link_marks_what_it_sends) {
    BOOST_TEST(classes_of("udp", "", "") == (std::vector<int>{0, 0}), boost::test_tools::per_element());
    BOOST_TEST(classes_of("udp", "?dscp=8", "?dscp=46") == (std::vector<int>{8 << 2, expedited << 2}),
               boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
