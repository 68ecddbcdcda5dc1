// SPDX-License-Identifier: BSL-1.0
#include "node/routing/relays.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

BOOST_FIXTURE_TEST_SUITE(relayed_bindings, cles::test::routing_fixture)

using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(second_bind_changes_the_terms_of_a_noun) {
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{}");
    link.take();
    BOOST_TEST(link.kind("BIND car2:pose id=8 every=1000") == "id=8 ok");
    BOOST_TEST(link.session().serving().bindings() == 1U);
    for (int i = 0; i < 3; ++i) {
        ways.bound("car2:pose").publishes("{\"x\":1}");
        drain();
    }
    BOOST_TEST(link.take_lines().size() == 1U);
}

BOOST_AUTO_TEST_CASE(nouns_are_compared_decoded) {
    link.ask("BIND car2:pose/a%41 id=7");
    ways.bound("car2:pose/aA").binds("{}");
    BOOST_TEST(link.sent() == "id=7 ok");
    BOOST_TEST(link.kind("BIND car2:pose/%61A lease=0 id=8") == "id=8 ok");
    BOOST_TEST(ways.count_bound() == 0U);
}

BOOST_AUTO_TEST_CASE(all_bindings_end_with_the_link) {
    link.ask("BIND car2:pose id=7");
    link.ask("BIND car3:pose id=8");
    ways.bound("car2:pose").binds("{}");
    link.reset();
    ways.bound("car3:pose").binds("{}");
    BOOST_TEST(ways.count_bound() == 0U);
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

// It was bound; later, a rule of the publisher has changed.
BOOST_AUTO_TEST_CASE(what_the_publisher_denies_later_is_denied) {
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{}");
    link.take();
    BOOST_TEST(link.denials == 0);
    ways.bound("car2:pose").to->on_denied({.code = cles::errc::denied, .message = "car2: not you"});
    BOOST_TEST(link.denials == 1);
    BOOST_TEST(link.kind("BIND car2:pose id=8") == "id=8 denied");
    ways.bound("car2:pose").binds("{}"); // it has changed again
    BOOST_TEST(link.kind("BIND car2:pose id=9") == "id=9 ok");
}

// However it ends, and whenever the other node replies.
BOOST_AUTO_TEST_CASE(binding_of_an_ended_call_is_not_accounted) {
    const auto is_idle = [&] {
        static_cast<void>(link.take());
        link.settle();
        return link.account->used() == 0;
    };
    link.ask("BIND car2:pose id=7 deadline=100");
    BOOST_TEST(link.account->used() != 0U);
    node.pass(100ms);
    BOOST_TEST(is_idle());
    link.ask("BIND car2:pose id=7");
    link.ask("PUSH self:cles/cancel/7 reply=no");
    BOOST_TEST(is_idle());
    link.ask("BIND car2:pose id=7");
    link.ask("BIND car2:pose lease=0");
    BOOST_TEST(is_idle());
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(is_idle());
    link.ask("BIND car3:pose id=7");
    ways.bound("car3:pose").refuses(cles::errc::denied, "not you");
    BOOST_TEST(is_idle());
}

BOOST_AUTO_TEST_CASE(bind_cancelled_before_its_reply_does_not_bind) {
    link.ask("BIND car2:pose id=7");
    link.ask("PUSH self:cles/cancel/7 reply=no");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(ways.count_bound() == 0U);
    link.ask("BIND all:pose id=8");
    link.take();
    offer("car3", task("BIND", "pose"));
    ways.bound("car3:pose").binds("{}");
    link.ask("BIND all:other id=9");
    offer("car4", task("BIND", "late"));
    link.ask("BIND all:late id=10");
    link.ask("PUSH self:cles/cancel/10 reply=no");
    ways.bound("car4:late").binds("{}");
    BOOST_TEST(ways.count_bound() == 1U); // car3:pose
}

BOOST_AUTO_TEST_SUITE_END()
