// SPDX-License-Identifier: BSL-1.0
#include "core/teller.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(teller)

using cles::core::teller;

BOOST_AUTO_TEST_CASE(a_source_in_the_group_is_an_ipv4_address) {
    const auto from = teller::of(cles::core::group_source{0x0A000007, 40000});
    BOOST_TEST(from.host == "10.0.0.7");
    BOOST_TEST(!from.local);
    BOOST_TEST(teller::of(cles::core::group_source{0x7F000001, 40000}).local);
}

BOOST_AUTO_TEST_CASE(who_was_asked_is_known_by_the_url) {
    BOOST_TEST(teller::at("tcp://10.0.0.7:1").host == "10.0.0.7");
    BOOST_TEST(!teller::at("tcp://10.0.0.7:1").local);
    BOOST_TEST(teller::at("udp://[2001:db8::1]:1").host == "2001:db8::1");
    BOOST_TEST(teller::at("tcp://127.0.0.1:1").local);
    BOOST_TEST(teller::at("tcp://[::1]:1").local);
}

BOOST_AUTO_TEST_CASE(who_is_reached_without_the_network_is_on_this_host) {
    for (const auto* url : {"unix:///run/a.sock", "unix://@a", "inproc://a"}) {
        BOOST_TEST(teller::at(url).host == "127.0.0.1");
        BOOST_TEST(teller::at(url).local);
    }
}

BOOST_AUTO_TEST_CASE(a_link_says_itself_whether_its_peer_is_on_this_host) {
    const cles::identity peer{
        .transport = "tcp", .address = "tcp://10.0.0.7:40000", .name = {}, .uid = {}, .local = true};
    BOOST_TEST(teller::of(peer).host == "10.0.0.7");
    BOOST_TEST(teller::of(peer).local);
}

BOOST_AUTO_TEST_CASE(what_is_no_url_is_nowhere) { BOOST_TEST(teller::at("nothing").host.empty()); }

BOOST_AUTO_TEST_SUITE_END()
