// SPDX-License-Identifier: BSL-1.0
// Bindings on a link that are pending until their handler decides.
#include <cles/error.hpp>

#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

namespace pending_bindings {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    fixture() { node.on_later(verb::bind, "pose"); }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace pending_bindings

BOOST_FIXTURE_TEST_SUITE(pending_bindings, fixture)

BOOST_AUTO_TEST_CASE(it_is_bound_only_when_the_handler_accepts) {
    BOOST_TEST(link.ask("BIND car1:pose/fast id=7").empty());
    BOOST_TEST(node.started.at(0)->parameters.at(0) == "fast");
    node.publish_now("pose/fast", "[1]");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(link.session().serving().bindings() == 0U);
    node.started[0]->call->done("");
    BOOST_TEST(link.take() == "id=7 [1]\n");
    node.publish_now("pose/fast", "[2]");
    BOOST_TEST(link.take() == "UPDATE car1:pose/fast seq=2 epoch=5f3a09c1 [2]\n");
}

BOOST_AUTO_TEST_CASE(it_is_not_bound_if_the_handler_refuses) {
    BOOST_TEST(link.ask("BIND car1:pose id=7").empty());
    node.started.at(0)->call->fail({.code = cles::errc::denied, .message = "not you"});
    BOOST_TEST(link.take() == "id=7 {\"error\":\"denied\",\"message\":\"car1: not you\"}\n");
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(without_an_id_later_requests_wait_for_it) {
    node.on(verb::pull, "speed", "7");
    link.ask("BIND car1:pose");
    BOOST_TEST(link.ask("PULL car1:speed").empty());
    node.started.at(0)->call->done("");
    BOOST_TEST(link.take() == "{}\n{\"value\":7}\n");
}

BOOST_AUTO_TEST_CASE(it_is_not_bound_after_its_deadline_even_if_accepted) {
    link.ask("BIND car1:pose id=7 deadline=100");
    node.pass(101ms);
    BOOST_TEST(link.sent() == "id=7 deadline");
    BOOST_TEST(node.started.at(0)->stopped);
    node.started[0]->call->done("");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(it_is_not_bound_if_unbound_meanwhile) {
    link.ask("BIND car1:pose id=7");
    BOOST_TEST(link.ask("BIND car1:pose id=8 lease=0") ==
               "id=7 {\"error\":\"cancelled\",\"message\":\"car1: it was unbound\"}\nid=8 {}\n");
    BOOST_TEST(node.started.at(0)->stopped);
    node.started[0]->call->done("");
    BOOST_TEST(link.session().serving().bindings() == 0U);
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(it_is_not_bound_if_cancelled) {
    link.ask("BIND car1:pose id=7");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7 id=8") == "id=7 cancelled, id=8 ok");
    BOOST_TEST(node.started.at(0)->stopped);
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(a_lost_link_leaves_nothing_behind) {
    link.ask("BIND car1:pose id=7");
    link.reset();
    BOOST_TEST(node.started.at(0)->stopped);
    node.started[0]->call->done("");
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(the_terms_of_the_last_bind_count) {
    link.ask("BIND car1:pose id=7 every=1000");
    link.ask("BIND car1:pose id=8");
    node.started.at(0)->call->done("");
    node.started.at(1)->call->done("");
    BOOST_TEST(link.sent() == "id=7 ok, id=8 ok");
    BOOST_TEST(link.session().serving().bindings() == 1U);
    node.publish_now("pose", "[1]");
    node.publish_now("pose", "[2]");
    BOOST_TEST(link.take_lines().size() == 2U); // the second one is not delayed
}

BOOST_AUTO_TEST_CASE(a_repeat_by_datagram_waits_for_the_same_decision) {
    cles::test::test_link datagrams{node, 1200};
    datagrams.ask("BIND car1:pose id=7");
    BOOST_TEST(datagrams.ask("BIND car1:pose id=7").empty());
    BOOST_TEST(node.started.size() == 1U);
    node.started[0]->call->done("");
    BOOST_TEST(datagrams.sent() == "id=7 ok");
    BOOST_TEST(datagrams.session().serving().bindings() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
