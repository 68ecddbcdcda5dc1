// SPDX-License-Identifier: BSL-1.0
#include "node/base/memory_budget.hpp"
#include "node/routing/all_binding.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>

BOOST_FIXTURE_TEST_SUITE(all_binding, cles::test::routing_fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(binds_all_publishers_and_replies_with_their_last_values) {
    offer("car2", task("BIND", "pose"));
    offer("car3", task("BIND", "pose"));
    offer("car4", task("PULL", "pose"));
    node.open("pose");
    node.publish_now("pose", "{\"x\":1}");
    BOOST_TEST(link.ask("BIND all:pose id=7").empty());
    BOOST_TEST(ways.count_bound() == 2U);
    ways.bound("car3:pose").binds("{\"x\":3}");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(link.take() == R"(id=7 {"results":{"car1":{"x":1},"car2":{},"car3":{"x":3}},"errors":{}})"
                              "\n");
    const auto line = ways.bound("car2:pose").publishes("{\"x\":2}");
    node.publish("pose", "{\"x\":4}");
    drain();
    BOOST_TEST(link.take() == "UPDATE car1:pose seq=2 epoch=5f3a09c1 {\"x\":4}\n" + line);
}

BOOST_AUTO_TEST_CASE(reply_with_mark_identifies_the_updates) {
    offer("car2", task("BIND", "pose"));
    offer("car3", task("BIND", "pose"));
    node.open("pose");
    node.publish_now("pose", "{\"x\":1}");
    link.ask("BIND all:pose id=7 mark=yes");
    ways.bound("car3:pose").binds("{\"x\":3}");
    ways.bound("car2:pose").binds_again(4, "{\"x\":2}");
    BOOST_TEST(link.take() == R"(id=7 {"results":{"car1":{"x":1},"car2":{"x":2},"car3":{"x":3}},"errors":{},)"
                              R"("marks":{"car1":{"seq":1,"epoch":"5f3a09c1"},"car2":{"seq":4,"epoch":"0000cafe"}}})"
                              "\n");
}

BOOST_AUTO_TEST_CASE(publishers_that_appear_later_are_bound_too) {
    BOOST_TEST(link.ask("BIND all:pose id=7") == "id=7 {\"results\":{},\"errors\":{}}\n");
    offer("car2", task("BIND", "pose"));
    ways.bound("car2:pose").binds("{\"x\":1}");
    BOOST_TEST(link.take().empty());
    const auto line = ways.bound("car2:pose").publishes("{\"x\":2}");
    drain();
    BOOST_TEST(link.take() == line);
}

BOOST_AUTO_TEST_CASE(refusing_node_is_listed_in_the_errors) {
    offer("car2", task("BIND", "pose"));
    link.ask("BIND all:pose id=7");
    ways.bound("car2:pose").refuses(errc::denied, "car2 does not allow it");
    BOOST_TEST(link.take() ==
               R"(id=7 {"results":{},"errors":{"car2":{"error":"denied","message":"car2 does not allow it"}}})"
               "\n");
}

BOOST_AUTO_TEST_CASE(node_is_bound_even_without_memory_for_its_last_value) {
    offer("car2", task("BIND", "pose"));
    link.ask("BIND all:pose id=7");
    cles::core::memory_reservation others{std::make_shared<cles::core::memory_account>(node.host->memory)};
    others.resize(node.host->memory.limit());
    ways.bound("car2:pose").binds("{\"x\":1}");
    others.resize(0);
    const auto reply = link.take();
    BOOST_TEST(reply.starts_with(R"(id=7 {"results":{},"errors":{"car2":{"error":"busy")"), reply);
    const auto line = ways.bound("car2:pose").publishes("{\"x\":2}");
    drain();
    BOOST_TEST(link.take() == line);
    leave("car2");
    offer("car3", task("BIND", "pose")); // makes it check which nodes are known
    ways.bound("car3:pose").binds("{}");
    BOOST_TEST(link.kind("BIND all:pose lease=0 id=8") == "id=8 ok");
    BOOST_TEST(ways.count_bound() == 0U);
}

BOOST_AUTO_TEST_CASE(replies_before_the_deadline) {
    offer("car2", task("BIND", "pose"));
    link.ask("BIND all:pose id=7 deadline=1000");
    node.pass(950ms);
    const auto reply = link.take();
    BOOST_TEST(reply.starts_with(R"(id=7 {"results":{},"errors":{"car2":{"error":"deadline")"), reply);
    ways.bound("car2:pose").binds("{}"); // it is bound nevertheless
    const auto line = ways.bound("car2:pose").publishes("{\"x\":2}");
    drain();
    BOOST_TEST(link.take() == line);
}

BOOST_AUTO_TEST_CASE(unbind_ends_all_bindings) {
    offer("car2", task("BIND", "pose"));
    node.open("pose");
    link.ask("BIND all:pose id=7");
    ways.bound("car2:pose").binds("{}");
    link.take();
    BOOST_TEST(link.kind("BIND all:pose lease=0 id=8") == "id=8 ok");
    BOOST_TEST(ways.count_bound() == 0U);
    BOOST_TEST(link.session().serving().bindings() == 0U);
    offer("car3", task("BIND", "pose"));
    BOOST_TEST(ways.count_bound() == 0U);
    node.publish_now("pose", "{}");
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(ends_with_its_link) {
    offer("car2", task("BIND", "pose"));
    link.ask("BIND all:pose id=7");
    link.reset();
    BOOST_TEST(node.counts().handlers_running == 0U);
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(ways.count_bound() == 0U);
    offer("car3", task("BIND", "pose"));
    BOOST_TEST(ways.count_bound() == 0U);
}

BOOST_AUTO_TEST_CASE(bindings_by_name_are_unchanged) {
    offer("car2", task("BIND", "pose"));
    link.ask("BIND car2:pose every=1000");
    ways.bound("car2:pose").binds("{}");
    link.ask("BIND all:pose");
    link.take();
    BOOST_TEST(link.kind("BIND all:pose lease=0") == "ok");
    BOOST_TEST(ways.count_bound() == 1U);
    BOOST_TEST(link.session().serving().bindings() == 1U);
}

BOOST_AUTO_TEST_CASE(each_publisher_is_thinned_separately) {
    offer("car2", task("BIND", "pose"));
    offer("car3", task("BIND", "pose"));
    link.ask("BIND all:pose every=1000");
    ways.bound("car2:pose").binds("{}");
    ways.bound("car3:pose").binds("{}");
    link.take();
    for (int i = 0; i < 3; ++i) {
        ways.bound("car2:pose").publishes("{\"x\":2}");
        ways.bound("car3:pose").publishes("{\"x\":3}");
        drain();
    }
    BOOST_TEST(link.take_lines().size() == 2U);
}

BOOST_AUTO_TEST_CASE(waits_for_discovery) {
    routing->hold();
    BOOST_TEST(link.ask("BIND all:pose id=7").empty());
    routing->release(false);
    BOOST_TEST(link.sent() == "id=7 ok");
}

BOOST_AUTO_TEST_CASE(second_bind_changes_the_terms) {
    offer("car2", task("BIND", "pose"));
    link.ask("BIND all:pose");
    ways.bound("car2:pose").binds("{}");
    link.take();
    BOOST_TEST(link.kind("BIND all:pose every=1000") == "ok");
    BOOST_TEST(ways.count_bound() == 1U);
    for (int i = 0; i < 3; ++i) {
        ways.bound("car2:pose").publishes("{\"x\":2}");
        drain();
    }
    BOOST_TEST(link.take_lines().size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
