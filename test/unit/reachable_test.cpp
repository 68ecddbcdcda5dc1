// SPDX-License-Identifier: BSL-1.0
#include "core/reachable.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

namespace reachable {
namespace {

using strings = std::vector<std::string>;

using cles::core::teller;

const auto loopback = teller::of(cles::core::group_source{0x7F000001, 40000});
const auto other_host = teller::of(cles::core::group_source{0x0A000007, 40000}); // 10.0.0.7

strings usable(const strings& announced, const teller& from) {
    return cles::core::reachable_endpoints(announced, from);
}
strings passed_on(const strings& announced, const teller& from) {
    return cles::core::endpoints_to_pass_on(announced, from);
}

void check(const strings& found, const strings& expected) {
    BOOST_TEST(found == expected, boost::test_tools::per_element());
}

} // namespace
} // namespace reachable

BOOST_AUTO_TEST_SUITE(reachable)

BOOST_AUTO_TEST_CASE(streams_come_before_datagrams_and_tcp_before_unix) {
    check(usable({"udp://127.0.0.1:1", "unix:///run/a.sock", "tcp://127.0.0.1:2"}, loopback),
          {"tcp://127.0.0.1:2", "unix:///run/a.sock", "udp://127.0.0.1:1"});
}

BOOST_AUTO_TEST_CASE(the_address_that_was_heard_comes_before_others_of_its_scheme) {
    check(usable({"tcp://192.168.1.2:1", "tcp://10.0.0.9:1", "tcp://10.0.0.7:1", "udp://10.0.0.7:1"}, other_host),
          {"tcp://10.0.0.7:1", "tcp://192.168.1.2:1", "tcp://10.0.0.9:1", "udp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(an_unspecified_address_means_the_datagrams_source) {
    check(usable({"tcp://0.0.0.0:25370", "udp://[::]:25370", "tcp://[0:0:0:0:0:0:0:0]:1"}, other_host),
          {"tcp://10.0.0.7:25370", "tcp://10.0.0.7:1", "udp://10.0.0.7:25370"});
}

BOOST_AUTO_TEST_CASE(who_is_on_another_host_cannot_send_to_this_ones_own_addresses) {
    const strings local{"tcp://127.0.0.1:1",         "tcp://127.9.9.9:1",  "tcp://[::1]:1",
                        "tcp://[0:0:0:0:0:0:0:1]:1", "unix:///run/a.sock", "unix://@a"};
    check(usable(local, other_host), {});
    BOOST_TEST(usable(local, loopback).size() == local.size());
}

BOOST_AUTO_TEST_CASE(what_could_lead_anywhere_is_left_out) {
    for (const auto* one : {"inproc://a",
                            "tcp://example.org:1",
                            "tcp://localhost:1",
                            "tcp://10.0.0:1",
                            "tcp://10.0.0.256:1",
                            "tcp://10.0.0.01:1",
                            "tcp://10.0.0.1.:1",
                            "tcp://10.0.0.1.2:1",
                            "tcp://167772161:1",
                            "tcp://[fe80::1%25lo]:1",
                            "tcp://[::ffff:7f00:1]:1",
                            "tcp://[::7f00:1]:1",
                            "tcp://[1:2:3:4:5:6:7]:1",
                            "tcp://[1:2:3:4:5:6:7:8:9]:1",
                            "tcp://[1::2::3]:1",
                            "tcp://[12345::]:1",
                            "tcp://[:1::]:1",
                            "tcp://[1:]:1",
                            "tcp://[ff02::1]:1",
                            "udp://239.255.25.37:1",
                            "udp://255.255.255.255:1",
                            "tcp://10.0.0.1:0",
                            "tcp://10.0.0.1:99999",
                            "tcp://",
                            "nothing",
                            "",
                            "unix://\n/a",
                            "unix:///\x1b[2J"}) {
        check(usable({one}, loopback), {});
    }
}

BOOST_AUTO_TEST_CASE(addresses_of_both_kinds_are_taken) {
    const strings good{"tcp://10.0.0.1:1", "tcp://1.2.3.4:1", "tcp://[2001:db8::1]:1", "tcp://[fd00:1:2:3:4:5:6:7]:1",
                       "tcp://[2001:DB8::]:1"};
    check(usable(good, other_host), good);
}

BOOST_AUTO_TEST_CASE(a_scheme_of_later_days_comes_last) {
    check(usable({"quic://10.0.0.7:1", "udp://10.0.0.7:1"}, other_host), {"udp://10.0.0.7:1", "quic://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(an_unspecified_address_is_not_one_of_ipv4_where_the_teller_is_known_by_ipv6) {
    const auto by_ipv6 = teller::at("tcp://[2001:db8::1]:25370");
    check(usable({"tcp://0.0.0.0:1", "tcp://[::]:2"}, by_ipv6), {"tcp://[2001:db8::1]:2"});
    check(usable({"tcp://0.0.0.0:1"}, teller{}), {});
}

BOOST_AUTO_TEST_CASE(what_is_passed_on_means_the_same_to_the_next_one) {
    const strings all{"tcp://0.0.0.0:1", "tcp://127.0.0.1:2", "unix://@a", "inproc://a", "udp://10.0.0.9:3", "nothing"};
    check(passed_on(all, other_host), {"tcp://10.0.0.7:1", "udp://10.0.0.9:3"});
    // The next one puts this host's address in, or is on this host too.
    check(passed_on(all, loopback), {"tcp://0.0.0.0:1", "tcp://127.0.0.1:2", "unix://@a", "udp://10.0.0.9:3"});
}

BOOST_AUTO_TEST_SUITE_END()
