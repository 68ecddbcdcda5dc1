// SPDX-License-Identifier: BSL-1.0
#include "node/routing/request_router.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

BOOST_FIXTURE_TEST_SUITE(routing, cles::test::routing_fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(any_and_all_wait_for_the_discovery_grace) {
    node.on(verb::pull, "speed", "1");
    routing->hold();
    BOOST_TEST(link.ask("PULL any:speed id=7").empty());
    BOOST_TEST(link.ask("PULL all:speed id=8").empty());
    routing->release(false);
    BOOST_TEST(link.take() == "id=7 {\"value\":1}\nid=8 {\"results\":{\"car1\":{\"value\":1}},\"errors\":{}}\n");
}

// Waiting requests are processed in a loop, and a handler may do anything.
BOOST_AUTO_TEST_CASE(a_request_that_waited_starts_in_a_later_task) {
    routing->hold();
    node.on_later(verb::delegate, "work");
    for (const auto* id : {"7", "8"}) {
        link.ask("DELEGATE any:work id=" + std::string{id});
        link.ask("DELEGATE all:work id=1" + std::string{id});
    }
    waits_for_turn = true;
    routing->release(false);
    BOOST_TEST(node.started.empty());
    BOOST_TEST(wakes != 0);
    have_turn();
    BOOST_TEST(node.started.size() == 4U);
}

BOOST_AUTO_TEST_CASE(requests_for_a_name_do_not_wait) {
    routing->hold();
    link.ask("PULL car2:speed id=7");
    BOOST_TEST(ways.count_open() == 1U);
}

BOOST_AUTO_TEST_CASE(a_node_discovered_in_the_grace_period_is_asked_after_it) {
    routing->hold();
    link.ask("PULL any:speed id=7");
    hear("car2");
    routing->release(false);
    BOOST_TEST(link.take().empty()); // the request for the tasks of car2 is pending
    BOOST_TEST(ways.to("car2").text == "PULL car2:cles");
    ways.to("car2").answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1");
}

BOOST_AUTO_TEST_CASE(what_nobody_serves_waits_on_for_the_seeds) {
    node.on(verb::pull, "own", "1");
    routing->hold();
    link.ask("PULL any:speed id=7");
    link.ask("PULL all:speed id=8");
    routing->release(true);
    node.pass(2s);
    BOOST_TEST(link.take().empty());
    BOOST_TEST(link.ask("PULL any:own id=9") == "id=9 {\"value\":1}\n");
    BOOST_TEST(link.ask("PULL all:own id=10") == "id=10 {\"results\":{\"car1\":{\"value\":1}},\"errors\":{}}\n");
    hear("car2");
    routing->release(false);
    ways.to("car2").answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1");
    BOOST_TEST(ways.count_open() == 2U);
}

BOOST_AUTO_TEST_CASE(what_nobody_serves_fails_when_the_seeds_have_been_heard) {
    routing->hold();
    link.ask("PULL any:speed id=7");
    link.ask("PULL all:speed id=8");
    routing->release(true);
    BOOST_TEST(link.take().empty());
    routing->release(false);
    BOOST_TEST(link.sent() == "id=7 no_target, id=8 no_target");
}

BOOST_AUTO_TEST_CASE(all_waits_until_the_tasks_of_each_node_are_known) {
    hear("car2", "a");
    hear("car3", "b");
    link.ask("PULL all:speed id=7");
    ways.to("car2").answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(ways.to("car2").text == "PULL car2:cles");
    ways.to("car3").fails(errc::deadline, "no answer was received in time");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1");
    ways.to("car2").answers("[1]");
    BOOST_TEST(link.take() == "id=7 {\"results\":{\"car2\":[1]},\"errors\":{}}\n");
}

BOOST_AUTO_TEST_CASE(any_does_not_wait_for_more_than_one) {
    offer("car2", task("PULL", "speed"));
    hear("car3", "b");
    link.ask("PULL any:speed id=7");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1");
}

BOOST_AUTO_TEST_CASE(a_waiting_request_ends_with_its_deadline_and_its_link) {
    routing->hold();
    link.ask("PULL any:speed id=7 deadline=100");
    link.ask("PULL all:speed id=8");
    node.pass(100ms);
    BOOST_TEST(link.sent() == "id=7 deadline");
    link.reset();
    routing->release(false);
    BOOST_TEST(link.take().empty());
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(a_request_for_this_node_is_served_locally) {
    node.on(verb::pull, "speed", "1");
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
    BOOST_TEST(link.kind("PULL self:speed") == "ok");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(it_does_not_route_after_stop) {
    routing->stop();
    BOOST_TEST(link.kind("PULL car2:speed") == "no_target");
    hear("car2");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
