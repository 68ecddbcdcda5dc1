// SPDX-License-Identifier: BSL-1.0
#include "node/membership/reachable_endpoints.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

namespace reachable_endpoints {
namespace {

using strings = std::vector<std::string>;

using cles::core::observed_source;

const auto loopback = observed_source::of(cles::core::group_source{0x7F000001, 40000});
const auto other_host = observed_source::of(cles::core::group_source{0x0A000007, 40000}); // 10.0.0.7

strings usable(const strings& announced, const observed_source& from) {
    return cles::core::reachable_endpoints(announced, from);
}
strings relayed_endpoints(const strings& announced, const observed_source& from) {
    return cles::core::endpoints_to_relay(announced, from);
}

void check(const strings& found, const strings& expected) {
    BOOST_TEST(found == expected, boost::test_tools::per_element());
}

} // namespace
} // namespace reachable_endpoints

BOOST_AUTO_TEST_SUITE(reachable_endpoints)

BOOST_AUTO_TEST_CASE(streams_come_before_datagrams_and_tcp_before_unix) {
    check(usable({"udp://127.0.0.1:1", "unix:///run/a.sock", "tcp://127.0.0.1:2"}, loopback),
          {"tcp://127.0.0.1:2", "unix:///run/a.sock", "udp://127.0.0.1:1"});
    check(usable({"udp://127.0.0.1:1", "unix:///run/a.sock", "tls://127.0.0.1:2"}, loopback),
          {"tls://127.0.0.1:2", "unix:///run/a.sock", "udp://127.0.0.1:1"});
}

BOOST_AUTO_TEST_CASE(source_address_comes_before_others_of_its_scheme) {
    check(usable({"tcp://192.168.1.2:1", "tcp://10.0.0.9:1", "tcp://10.0.0.7:1", "udp://10.0.0.7:1"}, other_host),
          {"tcp://10.0.0.7:1", "tcp://192.168.1.2:1", "tcp://10.0.0.9:1", "udp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(unspecified_address_means_the_source) {
    check(usable({"tcp://0.0.0.0:25370", "udp://[::]:25370", "tcp://[0:0:0:0:0:0:0:0]:1"}, other_host),
          {"tcp://10.0.0.7:25370", "tcp://10.0.0.7:1", "udp://10.0.0.7:25370"});
}

BOOST_AUTO_TEST_CASE(other_hosts_cannot_direct_to_local_addresses) {
    const strings local{"tcp://127.0.0.1:1",         "tcp://127.9.9.9:1",  "tcp://[::1]:1",
                        "tcp://[0:0:0:0:0:0:0:1]:1", "unix:///run/a.sock", "unix://@a"};
    check(usable(local, other_host), {});
    BOOST_TEST(usable(local, loopback).size() == local.size());
}

BOOST_AUTO_TEST_CASE(host_names_and_other_unsafe_endpoints_are_omitted) {
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

BOOST_AUTO_TEST_CASE(ipv4_and_ipv6_addresses_are_accepted) {
    const strings good{"tcp://10.0.0.1:1", "tcp://1.2.3.4:1", "tcp://[2001:db8::1]:1", "tcp://[fd00:1:2:3:4:5:6:7]:1",
                       "tcp://[2001:DB8::]:1"};
    check(usable(good, other_host), good);
}

BOOST_AUTO_TEST_CASE(unknown_scheme_comes_last) {
    check(usable({"quic://10.0.0.7:1", "udp://10.0.0.7:1"}, other_host), {"udp://10.0.0.7:1", "quic://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(unspecified_ipv4_address_needs_an_ipv4_source) {
    const auto by_ipv6 = observed_source::at("tcp://[2001:db8::1]:25370");
    check(usable({"tcp://0.0.0.0:1", "tcp://[::]:2"}, by_ipv6), {"tcp://[2001:db8::1]:2"});
    check(usable({"tcp://0.0.0.0:1"}, observed_source{}), {});
}

BOOST_AUTO_TEST_CASE(link_local_addresses_are_those_of_the_link_by_which_they_came) {
    const auto by_link = observed_source::at("tcp://[fe80::aa%25eth1]:25370");
    BOOST_TEST(by_link.zone() == "eth1");
    BOOST_TEST(other_host.zone().empty());
    check(usable({"tcp://[fe80::bb]:1", "tcp://[::]:2"}, by_link),
          {"tcp://[fe80::aa%25eth1]:2", "tcp://[fe80::bb%25eth1]:1"});
    check(usable({"tcp://[fe80::bb%25eth0]:1"}, by_link), {});
    check(usable({"tcp://[fe80::bb]:1", "tcp://[febf::1]:1"}, other_host), {});
    check(usable({"tcp://[fe80::bb]:1"}, loopback), {});
}

BOOST_AUTO_TEST_CASE(link_local_addresses_are_told_on_their_link_without_its_name) {
    const auto by_link = observed_source::at("tcp://[fe80::aa%25eth1]:25370");
    const auto relayed = relayed_endpoints({"tcp://[::]:1", "tcp://[fe80::bb]:2", "tcp://10.0.0.9:3"}, by_link);
    check(relayed, {"tcp://[fe80::aa%25eth1]:1", "tcp://[fe80::bb%25eth1]:2", "tcp://10.0.0.9:3"});
    check(cles::core::endpoints_on_link(relayed, "eth1"),
          {"tcp://[fe80::aa]:1", "tcp://[fe80::bb]:2", "tcp://10.0.0.9:3"});
    for (const auto* zone : {"", "eth", "eth10"}) {
        check(cles::core::endpoints_on_link(relayed, zone), {"tcp://10.0.0.9:3"});
    }
}

BOOST_AUTO_TEST_CASE(relayed_endpoints_mean_the_same_to_the_next_node) {
    const strings all{"tcp://0.0.0.0:1", "tcp://127.0.0.1:2", "unix://@a", "inproc://a", "udp://10.0.0.9:3", "nothing"};
    check(relayed_endpoints(all, other_host), {"tcp://10.0.0.7:1", "udp://10.0.0.9:3"});
    // The next node inserts this host's address, or is on this host too.
    check(relayed_endpoints(all, loopback), {"tcp://0.0.0.0:1", "tcp://127.0.0.1:2", "unix://@a", "udp://10.0.0.9:3"});
}

BOOST_AUTO_TEST_SUITE_END()
