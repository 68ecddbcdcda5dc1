// SPDX-License-Identifier: BSL-1.0
#include "node/membership/reachable_endpoints.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(observed_source)

using cles::core::observed_source;

BOOST_AUTO_TEST_CASE(group_source_is_an_ipv4_address) {
    const auto from = observed_source::of(cles::core::group_source{0x0A000007, 40000});
    BOOST_TEST(from.host == "10.0.0.7");
    BOOST_TEST(!from.local);
    BOOST_TEST(observed_source::of(cles::core::group_source{0x7F000001, 40000}).local);
}

BOOST_AUTO_TEST_CASE(asked_node_is_known_by_its_url) {
    BOOST_TEST(observed_source::at("tcp://10.0.0.7:1").host == "10.0.0.7");
    BOOST_TEST(!observed_source::at("tcp://10.0.0.7:1").local);
    BOOST_TEST(observed_source::at("udp://[2001:db8::1]:1").host == "2001:db8::1");
    BOOST_TEST(observed_source::at("tcp://127.0.0.1:1").local);
    BOOST_TEST(observed_source::at("tcp://[::1]:1").local);
}

BOOST_AUTO_TEST_CASE(unix_and_inproc_are_on_this_host) {
    for (const auto* url : {"unix:///run/a.sock", "unix://@a", "inproc://a"}) {
        BOOST_TEST(observed_source::at(url).host == "127.0.0.1");
        BOOST_TEST(observed_source::at(url).local);
    }
}

BOOST_AUTO_TEST_CASE(link_states_whether_its_peer_is_on_this_host) {
    const cles::identity peer{
        .transport = "tcp", .address = "tcp://10.0.0.7:40000", .name = {}, .uid = {}, .local = true};
    BOOST_TEST(observed_source::of(peer).host == "10.0.0.7");
    BOOST_TEST(observed_source::of(peer).local);
}

BOOST_AUTO_TEST_CASE(text_that_is_not_a_url_has_no_host) { BOOST_TEST(observed_source::at("nothing").host.empty()); }

BOOST_AUTO_TEST_SUITE_END()
