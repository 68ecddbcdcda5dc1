// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "port/ip_network.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(ip_network)

BOOST_AUTO_TEST_CASE(addresses_are_found_in_their_networks) {
    const cles::core::ip_networks known{{"10.0.0.0/8", "192.168.7.0/24", "fd00::/8", "203.0.113.9"}};
    BOOST_TEST(known.contain("10.1.2.3"));
    BOOST_TEST(!known.contain("11.1.2.3"));
    BOOST_TEST(known.contain("192.168.7.0"));
    BOOST_TEST(known.contain("192.168.7.255"));
    BOOST_TEST(!known.contain("192.168.8.1"));
    BOOST_TEST(known.contain("fd12::1"));
    BOOST_TEST(!known.contain("fe80::1"));
    BOOST_TEST(known.contain("203.0.113.9"));
    BOOST_TEST(!known.contain("203.0.113.10"));
    BOOST_TEST(!known.contain("car1.local"));
}

BOOST_AUTO_TEST_CASE(an_interface_does_not_matter) {
    const cles::core::ip_networks known{{"fe80::/10"}};
    BOOST_TEST(known.contain("fe80::1%lo"));
}

BOOST_AUTO_TEST_CASE(no_network_contains_nothing_and_prefix_0_contains_all) {
    BOOST_TEST(!cles::core::ip_networks{}.contain("10.0.0.1"));
    BOOST_TEST(cles::core::ip_networks{{"0.0.0.0/0"}}.contain("10.0.0.1"));
}

BOOST_AUTO_TEST_CASE(an_invalid_network_is_refused_by_name) {
    for (const auto* text : {"", "10.0.0.0/33", "10.0.0/8", "car1", "10.0.0.0/", "fd00::/129"}) {
        BOOST_CHECK_EXCEPTION(cles::core::ip_networks({text}), cles::error, [&](const cles::error& e) {
            return e.code() == cles::errc::invalid_url && e.message().find(text) != std::string::npos;
        });
    }
}

BOOST_AUTO_TEST_CASE(an_ipv6_host_counts_by_its_network) {
    BOOST_TEST(cles::core::share_of_address("2001:db8:1:2:3:4:5:6") == "2001:db8:1:2::/64");
    BOOST_TEST(cles::core::share_of_address("2001:db8:1:2::1") == cles::core::share_of_address("2001:db8:1:2::2"));
    for (const auto* alone : {"10.1.2.3", "::1", "fe80::1%lo", "::ffff:10.1.2.3", "car1.local", ""}) {
        BOOST_TEST(cles::core::share_of_address(alone) == alone);
    }
}

BOOST_AUTO_TEST_CASE(only_complete_addresses_are_parsed) {
    for (const auto* text : {"10.0.0", "10.0.0.256", "10.0.0.1 ", "fd00:::1", "1:2:3:4:5:6:7:8:9",
                             "0000:0000:0000:0000:0000:0000:0000:0000:0000:0000:0000"}) {
        BOOST_TEST(!cles::core::parse_ip_address(text).has_value());
    }
    const auto read = cles::core::parse_ip_address("fd00::1");
    BOOST_REQUIRE(read.has_value());
    BOOST_TEST(to_text(*read) == "fd00::1");
    BOOST_TEST(to_text(read->first_bits(7)) == "fc00::");
}

BOOST_AUTO_TEST_SUITE_END()
