// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "shell/networks.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(networks)

BOOST_AUTO_TEST_CASE(addresses_are_found_in_their_networks) {
    const cles::shell::networks known{{"10.0.0.0/8", "192.168.7.0/24", "fd00::/8", "203.0.113.9"}};
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
    const cles::shell::networks known{{"fe80::/10"}};
    BOOST_TEST(known.contain("fe80::1%lo"));
}

BOOST_AUTO_TEST_CASE(none_contain_nothing_and_0_contains_all) {
    BOOST_TEST(!cles::shell::networks{}.contain("10.0.0.1"));
    BOOST_TEST(cles::shell::networks{{"0.0.0.0/0"}}.contain("10.0.0.1"));
}

BOOST_AUTO_TEST_CASE(what_is_no_network_is_refused_by_name) {
    for (const auto* text : {"", "10.0.0.0/33", "10.0.0/8", "car1", "10.0.0.0/", "fd00::/129"}) {
        BOOST_CHECK_EXCEPTION(cles::shell::networks({text}), cles::error, [&](const cles::error& e) {
            return e.code() == cles::errc::invalid_url && e.message().find(text) != std::string::npos;
        });
    }
}

BOOST_AUTO_TEST_SUITE_END()
