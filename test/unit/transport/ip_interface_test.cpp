// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_interface.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>
#include <vector>

namespace ip_interface {
namespace {

using cles::core::automatic;
using interface = cles::core::network_interface;

interface card(std::string name, int index) {
    return {.name = std::move(name), .index = index, .address = 0x0a000007, .running = true, .multicast = true};
}

std::vector<std::string> names_of(const std::vector<interface>& all) {
    std::vector<std::string> names;
    for (const auto& each : all) {
        names.push_back(each.name);
    }
    return names;
}

} // namespace
} // namespace ip_interface

BOOST_AUTO_TEST_SUITE(ip_interface)

BOOST_AUTO_TEST_CASE(auto_selects_interfaces_with_a_link_an_address_and_multicast) {
    auto loopback = card("lo", 1); // whose flags lack multicast
    loopback.loopback = true;
    loopback.multicast = false;
    auto without_address = card("eth1", 4);
    without_address.address = {};
    auto without_link = card("docker0", 5);
    without_link.running = false;
    auto without_multicast = card("eth2", 6);
    without_multicast.multicast = false;
    auto tunnel = card("tun0", 7);
    tunnel.point_to_point = true;
    const std::vector<interface> all{card("eth0", 2), loopback,          without_address, without_link,
                                     tunnel,          without_multicast, card("wlan0", 8)};
    BOOST_TEST(names_of(automatic(all)) == (std::vector<std::string>{"lo", "eth0", "wlan0"}),
               boost::test_tools::per_element());
    BOOST_TEST(automatic({without_link, tunnel}).empty());
}

BOOST_AUTO_TEST_CASE(loopback_of_this_host_is_recognised) {
    const auto all = cles::transport::interfaces_of_host();
    const auto at = std::find_if(all.begin(), all.end(), [](const interface& each) { return each.name == "lo"; });
    BOOST_REQUIRE(at != all.end());
    const auto found = cles::transport::find_interface("lo");
    BOOST_TEST(at->index == found.index);
    BOOST_TEST(at->loopback);
    BOOST_TEST(found.loopback);
    BOOST_TEST((at->address == found.address));
    BOOST_TEST(found.name == "lo");
}

BOOST_AUTO_TEST_SUITE_END()
