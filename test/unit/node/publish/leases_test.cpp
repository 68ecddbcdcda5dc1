// SPDX-License-Identifier: BSL-1.0
#include "node/publish/binding.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <string>

namespace leases {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    fixture() {
        node.open("pose");
        node.publish("pose", "[0]");
    }
    /// Publishes once; returns how many updates the subscriber received.
    std::size_t updates() {
        node.publish_now("pose", "[1]");
        const auto got = link.take();
        return static_cast<std::size_t>(std::count(got.begin(), got.end(), '\n'));
    }
    std::size_t bindings() { return link.session().serving().bindings(); }

    cles::test::test_node node;
    cles::test::test_link link{node, cles::protocol::datagram_bytes};
    cles::test::test_link stream{node};
};

} // namespace
} // namespace leases

BOOST_FIXTURE_TEST_SUITE(leases, fixture)

BOOST_AUTO_TEST_CASE(a_binding_by_datagram_ends_when_its_lease_expires) {
    BOOST_TEST(link.ask("BIND car1:pose lease=2000") == "[0]\n");
    node.pass(1999ms);
    BOOST_TEST(updates() == 1U);
    node.pass(1ms);
    BOOST_TEST(updates() == 0U);
    BOOST_TEST(bindings() == 0U);
    BOOST_TEST(node.counts().leases_expired == 1U);
    BOOST_TEST(link.session().is_idle());
}

BOOST_AUTO_TEST_CASE(the_default_is_10_s) {
    link.ask("BIND car1:pose");
    node.pass(9999ms);
    BOOST_TEST(bindings() == 1U);
    node.pass(1ms);
    BOOST_TEST(bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(more_than_60_s_counts_as_60_s) {
    link.ask("BIND car1:pose lease=86400000");
    node.pass(59'999ms);
    BOOST_TEST(bindings() == 1U);
    node.pass(1ms);
    BOOST_TEST(bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(bind_again_renews) {
    for (int i = 0; i < 5; ++i) {
        BOOST_TEST(link.kind("BIND car1:pose lease=2000") == "ok");
        node.pass(1500ms);
        BOOST_TEST(updates() == 1U);
    }
    node.pass(500ms);
    BOOST_TEST(updates() == 0U);
}

BOOST_AUTO_TEST_CASE(lease_0_unbinds) {
    link.ask("BIND car1:pose lease=2000");
    BOOST_TEST(link.ask("BIND car1:pose lease=0") == "{}\n");
    BOOST_TEST(updates() == 0U);
    BOOST_TEST(link.ask("BIND car1:pose lease=0") == "{}\n");
    node.pass(1h);
    BOOST_TEST(node.counts().leases_expired == 0U);
}

BOOST_AUTO_TEST_CASE(each_noun_has_its_own_lease) {
    link.ask("BIND car1:pose lease=1000");
    link.ask("BIND car1:pose/fast lease=5000");
    node.pass(1s);
    BOOST_TEST(bindings() == 1U);
    node.pass(4s);
    BOOST_TEST(bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(a_refused_bind_starts_no_lease) {
    BOOST_TEST(link.kind("BIND car1:nothing lease=1000") == "no_task");
    node.pass(1h);
    BOOST_TEST(node.counts().leases_expired == 0U);
}

BOOST_AUTO_TEST_CASE(on_a_stream_a_binding_lives_as_long_as_its_link) {
    stream.ask("BIND car1:pose lease=1000");
    node.pass(1h);
    BOOST_TEST(stream.session().serving().bindings() == 1U);
}

BOOST_AUTO_TEST_CASE(a_renewal_does_not_change_every) {
    link.ask("BIND car1:pose every=1000 lease=3000");
    BOOST_TEST(updates() == 1U);
    BOOST_TEST(updates() == 0U); // suppressed by `every`
    link.ask("BIND car1:pose every=1000 lease=3000");
    node.drain();
    BOOST_TEST(link.take().empty()); // a renewal does not make it send more often
    BOOST_TEST(updates() == 0U);
    node.pass(1000ms);
    const auto newest = link.take();
    BOOST_TEST(newest.find("seq=4 ") != std::string::npos, newest);
}

BOOST_AUTO_TEST_CASE(other_terms_replace_those_of_the_binding) {
    link.ask("BIND car1:pose every=60000 lease=3000");
    updates();
    link.ask("BIND car1:pose lease=3000");
    BOOST_TEST(updates() == 1U);
    BOOST_TEST(updates() == 1U);
}

BOOST_AUTO_TEST_CASE(a_bind_with_a_value_that_is_too_large_fails_but_binds) {
    node.publish("pose", "\"" + std::string(1300, 'x') + "\"");
    const auto told = link.reply("BIND car1:pose");
    BOOST_TEST(told.error == "too_large");
    BOOST_TEST(told.ran);
    BOOST_TEST(updates() == 1U);
}

BOOST_AUTO_TEST_CASE(leases_end_with_their_link) {
    link.ask("BIND car1:pose lease=1000");
    link.reset();
    node.pass(1h);
    BOOST_TEST(node.counts().leases_expired == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
