// SPDX-License-Identifier: BSL-1.0
// A leaving node, and its peers: docs/protocol.md, "Leaving".
#include "node/routing/subrequest.hpp"
#include "support/recorded_reply.hpp"
#include "support/sent_request.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace leaving {
namespace {

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;
using cles::test::send_on;

const std::string farewell = "PUSH self:cles/leaving reply=no\n";

struct fixture {
    std::shared_ptr<cles::test::outcome> ask_peer(std::uint64_t id) {
        auto result = send_on(link, node, {.verb = verb::delegate, .noun = "car2:work", .id = id});
        link.take();
        return result;
    }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace leaving

BOOST_FIXTURE_TEST_SUITE(leaving, fixture)

BOOST_AUTO_TEST_CASE(running_requests_are_answered_and_no_others_started) {
    node.on_later(verb::delegate, "work");
    int ran = 0;
    node.on(verb::pull, "speed", [&ran](const cles::request&, cles::json_writer& w) { w.value(std::int64_t{++ran}); });
    link.ask("DELEGATE self:work id=1");
    link.ask("DELEGATE self:work"); // further requests without an id wait for it
    link.ask("PULL self:speed");
    link.session().serving().refuse_new_requests();
    BOOST_TEST(link.kind("PULL self:speed id=2") == "id=2 busy");
    BOOST_TEST(link.reply("DELEGATE self:work id=3").message == "car1 is shutting down");
    BOOST_TEST(link.ask("PULL self:speed").empty()); // it waits for its turn
    BOOST_TEST(link.ask("PUSH self:speed reply=no").empty());
    BOOST_TEST(link.session().serving().in_flight() != 0U);
    node.started.at(1)->call->done("{}");
    BOOST_TEST(link.sent() == "ok, busy, busy");
    node.started.at(0)->call->done("{}");
    BOOST_TEST(link.sent() == "id=1 ok");
    BOOST_TEST(ran == 0);
    BOOST_TEST(link.session().serving().in_flight() == 0U);
}

BOOST_AUTO_TEST_CASE(running_requests_can_still_be_cancelled) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE self:work id=1");
    link.session().serving().refuse_new_requests();
    BOOST_TEST(link.kind("PUSH self:cles/cancel/1 reply=no") == "id=1 cancelled");
    BOOST_TEST(node.started.at(0)->stopped);
}

BOOST_AUTO_TEST_CASE(requests_that_exceed_the_time_are_aborted) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE self:work id=1");
    link.ask("DELEGATE self:work");
    link.session().serving().refuse_new_requests();
    link.session().serving().abort_running();
    const auto lines = link.take_lines();
    BOOST_REQUIRE_EQUAL(lines.size(), 2U);
    BOOST_TEST(lines[0] ==
               "id=1 {\"error\":\"unavailable\",\"message\":\"car1 shut down before the request had ended\"}");
    BOOST_TEST(cles::test::kind_of(lines[1]) == "unavailable");
    BOOST_TEST(node.started.at(0)->stopped);
    BOOST_TEST(node.started.at(1)->stopped);
    BOOST_TEST(link.session().serving().in_flight() == 0U);
}

// There is no further turn before the last line.
BOOST_AUTO_TEST_CASE(waiting_requests_are_busy_before_the_last_line) {
    constexpr std::size_t more_than_one_turn_serves = 400;
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE self:work");
    for (std::size_t i = 0; i < more_than_one_turn_serves; ++i) {
        link.ask("DELEGATE self:work");
    }
    link.session().serving().abort_running();
    link.session().send_leave_notice();
    const auto lines = link.take_lines();
    BOOST_REQUIRE_EQUAL(lines.size(), more_than_one_turn_serves + 2);
    BOOST_TEST(cles::test::kind_of(lines[0]) == "unavailable");
    for (std::size_t i = 1; i <= more_than_one_turn_serves; ++i) {
        BOOST_REQUIRE(cles::test::kind_of(lines[i]) == "busy");
    }
    BOOST_TEST(lines.back() + "\n" == farewell);
    BOOST_TEST(node.started.size() == 1U);
    BOOST_TEST(link.session().serving().in_flight() == 0U);
}

BOOST_AUTO_TEST_CASE(last_line_is_the_leave_notice) {
    link.session().serving().refuse_new_requests();
    link.session().send_leave_notice();
    link.session().send_leave_notice();
    BOOST_TEST(link.take() == farewell);
    BOOST_TEST(link.finishes == 1);
    BOOST_TEST(link.ask("PULL self:cles").empty()); // nothing follows
}

BOOST_AUTO_TEST_CASE(no_leave_notice_by_datagram) {
    cles::test::test_link datagrams{node, 1200};
    datagrams.session().send_leave_notice();
    BOOST_TEST(datagrams.take().empty());
    BOOST_TEST(datagrams.finishes == 0);
    const auto waiting = send_on(datagrams, node, {.verb = verb::pull, .noun = "car2:speed", .id = 7});
    datagrams.ask("PUSH self:cles/leaving reply=no id=3"); // any sender could forge it
    BOOST_TEST(!waiting->ended);
}

BOOST_AUTO_TEST_CASE(requests_that_a_leaving_node_has_not_answered_were_not_started) {
    const auto first = ask_peer(7);
    const auto second = ask_peer(8);
    link.ask("id=7 {}");
    BOOST_TEST(link.ask("PUSH self:cles/leaving reply=no").empty());
    BOOST_TEST(!first->code);
    BOOST_TEST((second->code == errc::busy));
    BOOST_TEST(second->text == "the node at tcp://127.0.0.1:1 is leaving, and has not started this request");
    BOOST_TEST(link.retires == 1); // no more requests are sent on it
    BOOST_TEST(link.session().asking().in_flight() == 0U);
    link.half_close();
    BOOST_TEST(node.counts().errors_unsent == 0U);
}

BOOST_AUTO_TEST_CASE(request_to_any_continues_with_another_node_as_if_busy) {
    const auto failures = std::make_shared<std::vector<cles::core::subrequest_failure>>();
    const auto now = node.clock.now();
    link.session().asking().send({.verb = verb::delegate, .noun = "car2:work", .id = 9}, now + 5s, now,
                                 cles::detail::pending_ptr{new cles::core::subrequest{
                                     [failures](std::string_view, cles::core::subrequest_failure* why) {
                                         if (why != nullptr) {
                                             failures->push_back(*why);
                                         }
                                     }}});
    link.ask("PUSH self:cles/leaving reply=no");
    BOOST_REQUIRE_EQUAL(failures->size(), 1U);
    BOOST_TEST(((*failures)[0].reported.code == errc::busy));
    BOOST_TEST(!(*failures)[0].may_have_started);
    BOOST_TEST((*failures)[0].reported.retry_ms.value_or(0) == 1000U);
}

BOOST_AUTO_TEST_CASE(closed_link_without_a_leave_notice_leaves_open_what_started) {
    const auto result = ask_peer(7);
    link.half_close();
    BOOST_TEST((result->code == errc::unavailable));
}

BOOST_AUTO_TEST_CASE(request_that_wants_a_reply_is_not_a_leave_notice) {
    const auto result = ask_peer(7);
    BOOST_TEST(link.kind("PUSH self:cles/leaving id=1") == "id=1 no_task");
    BOOST_TEST(!result->ended);
}

BOOST_AUTO_TEST_SUITE_END()
