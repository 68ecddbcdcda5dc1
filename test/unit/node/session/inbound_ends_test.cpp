// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>

namespace inbound_ends {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    fixture() {
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on(verb::push, "log", std::string{});
        node.on_later(verb::delegate, "work");
        node.open("pose");
    }
    cles::test::test_node::running& started(std::size_t i) { return *node.started.at(i); }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace inbound_ends

BOOST_FIXTURE_TEST_SUITE(inbound_ends, fixture)

BOOST_AUTO_TEST_SUITE(half_close)

BOOST_AUTO_TEST_CASE(a_last_line_without_its_lf_is_bad_request_and_does_not_run) {
    link.cut("PULL car1:speed id=7");
    BOOST_TEST(link.take() == R"(id=7 {"error":"bad_request","message":"car1: the last line does not end with LF"})"
                              "\n");
    link.cut("PULL car1:speed");
    BOOST_TEST(link.sent() == "bad_request");
    link.cut("PUSH car1:log reply=no {\"a\"");
    link.cut("{\"v\":3");
    link.cut("  \r");
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(the_node_closes_if_nothing_is_left) {
    link.ask("PULL car1:speed");
    link.half_close();
    BOOST_TEST(link.finishes == 1);
}

BOOST_AUTO_TEST_CASE(requests_without_id_are_still_answered_then_the_node_closes) {
    link.ask("DELEGATE car1:work/a");
    link.ask("PULL car1:speed");
    link.ask("DELEGATE car1:work/b");
    link.ask("FLY");
    link.half_close();
    BOOST_TEST(link.finishes == 0);
    started(0).call->done("[1]");
    BOOST_TEST(link.take() == "[1]\n{\"v\":3}\n");
    BOOST_TEST(link.finishes == 0);
    BOOST_TEST(!started(1).stopped);
    started(1).call->done("[2]");
    BOOST_TEST(link.sent() == "ok, bad_request");
    BOOST_TEST(link.finishes == 1);
}

BOOST_AUTO_TEST_CASE(requests_with_id_are_cancelled) {
    link.ask("DELEGATE car1:work id=7");
    link.ask("DELEGATE car1:work");
    link.half_close();
    BOOST_TEST(link.sent() == "id=7 cancelled");
    BOOST_TEST(started(0).stopped);
    BOOST_TEST(!started(1).stopped);
    BOOST_TEST(link.finishes == 0);
}

BOOST_AUTO_TEST_CASE(remaining_requests_end_at_their_deadline) {
    link.ask("DELEGATE car1:work deadline=100");
    link.half_close();
    node.pass(100ms);
    BOOST_TEST(link.sent() == "deadline");
    BOOST_TEST(link.finishes == 1);
}

BOOST_AUTO_TEST_CASE(bindings_stay) {
    link.ask("BIND car1:pose");
    link.half_close();
    BOOST_TEST(link.finishes == 0);
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.take() == "UPDATE car1:pose seq=1 epoch=5f3a09c1 [1]\n");
    link.reset(); // a write failed
    node.publish_now("pose", "[2]");
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(a_bind_that_waits_its_turn_is_made_and_stays) {
    link.ask("DELEGATE car1:work");
    link.ask("BIND car1:pose");
    link.half_close();
    started(0).call->done("[1]");
    BOOST_TEST(link.sent() == "ok, ok");
    BOOST_TEST(link.finishes == 0);
    node.publish_now("pose", "[1]");
    BOOST_TEST(!link.take().empty());
}

BOOST_AUTO_TEST_CASE(the_last_unbind_closes) {
    link.ask("BIND car1:pose");
    link.ask("DELEGATE car1:work");
    link.ask("BIND car1:pose lease=0");
    link.half_close();
    BOOST_TEST(link.finishes == 0);
    started(0).call->done("[1]");
    link.turn();
    BOOST_TEST(link.finishes == 1);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(reset)

BOOST_AUTO_TEST_CASE(a_reset_cancels_everything) {
    link.ask("DELEGATE car1:work id=7");
    link.ask("DELEGATE car1:work");
    link.ask("PUSH car1:log");
    link.ask("BIND car1:pose id=8");
    link.take();
    link.reset();
    BOOST_TEST(started(0).stopped);
    BOOST_TEST(started(1).stopped);
    started(0).call->done("[1]");
    started(1).call->done("[1]");
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(node.host->deadlines.size() == 0U);
    BOOST_TEST(link.session().serving().bindings() == 0U);
    BOOST_TEST(link.session().serving().in_flight() == 0U);
}

BOOST_AUTO_TEST_CASE(waiting_requests_do_not_run) {
    int ran = 0;
    node.on(verb::push, "count", [&](const cles::request&, cles::json_writer&) { ++ran; });
    link.ask("DELEGATE car1:work");
    link.ask("PUSH car1:count");
    link.reset();
    started(0).call->done("[1]");
    BOOST_TEST(ran == 0);
}

BOOST_AUTO_TEST_CASE(a_handler_may_be_stopped_after_its_link_is_destroyed) {
    {
        cles::test::test_link brief{node};
        brief.ask("DELEGATE car1:work id=7");
    }
    BOOST_TEST(started(0).stopped);
    BOOST_TEST(!started(0).call->progress(0.5, "{}"));
    started(0).call->done("[1]");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(overlong)

BOOST_AUTO_TEST_CASE(a_line_over_the_limit_is_answered_too_large_and_the_link_ends) {
    link.overlong("PUSH car1:log {\"x\":\"xxxxxxxxx");
    const auto reply = cles::test::read_reply(link.take_lines().at(0));
    BOOST_TEST(reply.error == "too_large");
    BOOST_TEST(!reply.ran);
    BOOST_TEST(reply.message.find("1048576") != std::string::npos);
    BOOST_TEST(link.finishes == 1);
    BOOST_TEST(link.closes == 0);
}

BOOST_AUTO_TEST_CASE(the_reply_has_the_id_if_the_head_has_exactly_one_valid_id) {
    struct example {
        std::string_view head;
        std::string_view answer;
    };
    const example examples[] = {
        {"PUSH car1:log id=7 {\"x\":\"xxx", "id=7 too_large"},
        {"PUSH car1:log id=7 id=8 {\"x", "too_large"},
        {"PUSH car1:log {\"x\": id=7 ", "too_large"},
        {"xxxxxxxxxxxxxxxxxxxxx", "too_large"},
        {"PUSH car1:log reply=no {\"x", ""},
        {"UPDATE car1:log seq=1 epoch=0000000a {\"x", ""},
        {"PULL car1:log/xxxxxxx", "too_large"},
    };
    for (const auto& e : examples) {
        cles::test::test_link wide{node};
        wide.overlong(e.head);
        BOOST_TEST(wide.sent() == e.answer, e.head);
        BOOST_TEST(wide.finishes == 1, e.head);
    }
}

BOOST_AUTO_TEST_CASE(without_an_id_it_is_answered_in_order_before_the_link_ends) {
    link.ask("DELEGATE car1:work");
    link.ask("DELEGATE car1:work id=8");
    link.overlong("PUSH car1:log {\"x");
    BOOST_TEST(link.sent() == "id=8 cancelled");
    BOOST_TEST(link.finishes == 0);
    started(0).call->done("[1]");
    BOOST_TEST(link.sent() == "ok, too_large");
    BOOST_TEST(link.finishes == 1);
}

BOOST_AUTO_TEST_CASE(bindings_do_not_keep_the_link_open) {
    link.ask("BIND car1:pose");
    link.overlong("PUSH car1:log {\"x");
    BOOST_TEST(link.finishes == 1);
}

BOOST_AUTO_TEST_CASE(a_reply_over_the_limit_is_not_answered_and_the_link_ends) {
    link.overlong("id=7 {\"x\":\"xxxx");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(node.counts().replies_dropped == 1U);
    BOOST_TEST(link.finishes == 1);
    BOOST_TEST(link.ask("PULL car1:speed").empty());
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
