// SPDX-License-Identifier: BSL-1.0
#include "node/session/datagram_rules.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

namespace datagram_output {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t headers = 28;

struct fixture {
    cles::core::datagram_output output(std::string stranger = {}) {
        return {*node.host, 1200, std::move(stranger), headers};
    }
    /// How many of the lines may be sent now.
    std::size_t leaving(cles::core::datagram_output& to, std::size_t lines, std::size_t size) {
        std::string out;
        for (std::size_t i = 0; i < lines; ++i) {
            out += std::string(size - 1, static_cast<char>('a' + i % 26)) + "\n";
        }
        to.limit(out, node.clock.now());
        return out.size() / size;
    }

    cles::test::test_node node;
    std::string out;
};

} // namespace
} // namespace datagram_output

BOOST_FIXTURE_TEST_SUITE(datagram_output, fixture)

BOOST_AUTO_TEST_CASE(an_update_over_1200_bytes_is_not_sent_but_counted) {
    auto to = output();
    const std::string fits(1199, 'x');
    to.append_updates(out, "a\n" + fits + "x\n" + fits + "\nb\n");
    BOOST_TEST((out == "a\n" + fits + "\nb\n"));
    BOOST_TEST(node.counts().updates_too_large == 1U);
}

BOOST_AUTO_TEST_CASE(an_unverified_address_gets_less_than_64_KiB_a_second) {
    auto to = output("192.0.2.1");
    std::size_t sent = 0;
    for (int i = 0; i < 1000; ++i) {
        sent += leaving(to, 10, 100) * (100 + headers);
        node.pass(1ms);
    }
    BOOST_TEST(sent < 65536U);
    BOOST_TEST(sent > 60000U);
    BOOST_TEST(node.counts().datagrams_withheld == 10000U - sent / (100 + headers));
}

BOOST_AUTO_TEST_CASE(the_remaining_lines_keep_their_order) {
    auto to = output("192.0.2.1");
    out = std::string(14000, 'a') + "\n" + std::string(5000, 'b') + "\nc\nd\n";
    to.limit(out, node.clock.now());
    BOOST_TEST((out == std::string(14000, 'a') + "\nc\nd\n"));
}

BOOST_AUTO_TEST_CASE(two_ports_of_a_host_share_its_limit) {
    auto one = output("192.0.2.1");
    auto two = output("192.0.2.1");
    while (leaving(one, 1, 1000) != 0) {
    }
    BOOST_TEST(leaving(two, 1, 1000) == 0U);
}

BOOST_AUTO_TEST_CASE(loopback_and_configured_networks_have_no_limit) {
    auto to = output();
    BOOST_TEST(leaving(to, 1000, 1000) == 1000U);
    BOOST_TEST(node.counts().datagrams_withheld == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
