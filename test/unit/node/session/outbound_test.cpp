// SPDX-License-Identifier: BSL-1.0
#include "node/routing/subrequest.hpp"
#include "node/session/outbound.hpp"
#include "support/recorded_reply.hpp"
#include "support/sent_request.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace outbound {
namespace {

using cles::errc;
using cles::verb;
using cles::test::outcome;
using cles::test::send_on;
using namespace std::chrono_literals;

struct fixture {
    std::shared_ptr<outcome> send(std::uint64_t id, verb v = verb::pull, std::chrono::milliseconds limit = 5s,
                                  cles::core::outbound::progress_function progress = {}) {
        return send_on(link, node, {.verb = v, .noun = "car2:speed", .id = id}, limit, std::move(progress));
    }
    std::size_t in_flight() { return link.session().asking().in_flight(); }
    std::uint64_t dropped() { return node.counts().replies_dropped; }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace outbound

BOOST_FIXTURE_TEST_SUITE(outbound, fixture)

BOOST_AUTO_TEST_CASE(a_request_goes_out_with_its_id_and_is_answered_by_it) {
    const auto seven = send(7);
    const auto eight = send(8, verb::delegate, 30s);
    BOOST_TEST(link.take() == "PULL car2:speed id=7\nDELEGATE car2:speed id=8\n");
    BOOST_TEST(link.wakes == 2);
    BOOST_TEST(node.counts().requests_sent == 2U);
    BOOST_TEST(link.ask("id=8 {\"b\":2}").empty());
    BOOST_TEST(eight->ended);
    BOOST_TEST(eight->text == "{\"b\":2}");
    BOOST_TEST(!seven->ended);
    link.ask("id=7 [1]");
    BOOST_TEST(seven->text == "[1]");
    BOOST_TEST(in_flight() == 0U);
    BOOST_TEST(dropped() == 0U);
}

BOOST_AUTO_TEST_CASE(a_request_over_the_limit_on_a_line_is_not_sent) {
    const std::string head = "PUSH car2:speed id=1 ";
    const std::string body(node.host->bounds.line - head.size(), '1');
    const auto push = [&](std::uint64_t id, std::string_view with) {
        return send_on(link, node, {.verb = verb::push, .noun = "car2:speed", .id = id, .body = with});
    };
    const auto just_fits = push(1, body);
    BOOST_TEST(link.take().size() == node.host->bounds.line + 1);
    const auto too_long = push(2, body + "1");
    BOOST_TEST(!too_long->ended); // not inside the initiation
    node.pass(0ms);
    BOOST_TEST((too_long->code == errc::too_large));
    BOOST_TEST(link.take().empty()); // otherwise the peer would close the link, and cancel the other request
    link.ask("id=1 {}");
    BOOST_TEST(just_fits->text == "{}");
}

BOOST_AUTO_TEST_CASE(a_deadline_other_than_the_default_is_sent_to_the_peer) {
    send(1, verb::pull, 1500ms);
    send(2, verb::delegate, 5s);
    send(3, verb::pull, 5s);
    send(4, verb::pull, 24h);
    BOOST_TEST(link.take() == "PULL car2:speed id=1 deadline=1500\n"
                              "DELEGATE car2:speed id=2 deadline=5000\n"
                              "PULL car2:speed id=3\n"
                              "PULL car2:speed id=4 deadline=86400000\n");
}

BOOST_AUTO_TEST_CASE(the_remaining_time_is_sent) {
    auto [operation, result] = cles::test::record();
    const auto due = node.clock.now() + 1s;
    node.pass(400ms);
    link.session().asking().send({.verb = verb::pull, .noun = "car2:speed", .id = 7}, due, node.clock.now(),
                                 std::move(operation));
    BOOST_TEST(link.take() == "PULL car2:speed id=7 deadline=600\n");
    node.pass(599ms);
    BOOST_TEST(!result->ended);
    node.pass(1ms);
    BOOST_TEST((result->code == errc::deadline));
}

BOOST_AUTO_TEST_CASE(a_request_without_an_answer_ends_at_its_deadline) {
    const auto result = send(7, verb::pull, 200ms);
    node.pass(199ms);
    BOOST_TEST(!result->ended);
    node.pass(1ms);
    BOOST_TEST((result->code == errc::deadline));
    BOOST_TEST(in_flight() == 0U);
    link.ask("id=7 {}"); // too late
    BOOST_TEST(dropped() == 1U);
}

// The peer counts from when it has read the request: its job would go on for as long as the request was on its way.
BOOST_AUTO_TEST_CASE(a_job_whose_deadline_passes_is_cancelled_at_the_peer) {
    send(7, verb::delegate, 200ms);
    link.take();
    node.pass(200ms);
    BOOST_TEST(link.take() == "PUSH self:cles/cancel/7 reply=no\n");
    send(8, verb::delegate, 200ms);
    link.take();
    link.ask("id=8 {}");
    node.pass(200ms);
    BOOST_TEST(link.take() == "");
}

BOOST_AUTO_TEST_CASE(other_requests_are_not_cancelled_at_their_deadline) {
    for (const auto v : {verb::pull, verb::push, verb::bind}) {
        send(7, v, 200ms);
        link.take();
        node.pass(200ms);
        BOOST_TEST(link.take() == "");
    }
}

BOOST_AUTO_TEST_CASE(a_failure_has_its_code_and_the_peers_message) {
    const auto result = send(7);
    link.ask("id=7 {\"error\":\"no_task\",\"message\":\"car2 has no PULL 'speed'\"}");
    BOOST_TEST((result->code == errc::no_task));
    BOOST_TEST(result->text == "car2 has no PULL 'speed'");
}

BOOST_AUTO_TEST_CASE(an_unknown_error_code_counts_as_failed) {
    const auto result = send(7);
    link.ask("id=7 {\"error\":\"overheated\",\"message\":\"99\"}");
    BOOST_TEST((result->code == errc::failed));
    BOOST_TEST(result->text == "99");
}

BOOST_AUTO_TEST_CASE(a_reply_is_never_answered_and_counted_if_it_has_no_request) {
    const std::string_view stray[] = {"id=7 {}",
                                      "{}",
                                      "[1]",
                                      "id=0 {}",
                                      "id=x {}",
                                      "id=7",
                                      "{",
                                      "[",
                                      "id=7 {\"error\":\"busy\"}",
                                      "id=7 progress=0.5 {}",
                                      "id=9223372036854775808 {}"};
    std::uint64_t count = 0;
    for (const auto line : stray) {
        BOOST_TEST(link.ask(line).empty(), line);
        BOOST_TEST(dropped() == ++count, line);
    }
    BOOST_TEST(link.closes == 0);
    BOOST_TEST(link.finishes == 0);
}

BOOST_AUTO_TEST_CASE(a_malformed_reply_is_dropped_and_its_request_keeps_waiting) {
    const auto result = send(7, verb::pull, 200ms);
    const std::string_view broken[] = {"id=7 {\"a\":", "id=7 {\"a\":1} x",   "id=7 [\xFF]", "id=7 {\"error\":\"busy\"",
                                       "id=7",         "id=7 progress=2 {}", "id=7 {'a':1}"};
    std::uint64_t count = 0;
    for (const auto line : broken) {
        link.ask(line);
        BOOST_TEST(!result->ended, line);
        BOOST_TEST(dropped() == ++count, line);
    }
    link.ask("id=7 {\"a\":1}");
    BOOST_TEST(result->text == "{\"a\":1}");
}

BOOST_AUTO_TEST_CASE(a_malformed_reply_does_not_move_the_deadline) {
    const auto result = send(7, verb::pull, 200ms);
    node.pass(150ms);
    link.ask("id=7 {");
    node.pass(49ms);
    BOOST_TEST(!result->ended);
    node.pass(1ms);
    BOOST_TEST((result->code == errc::deadline));
}

BOOST_AUTO_TEST_CASE(interim_replies_precede_the_result) {
    std::vector<std::string> reports;
    const auto result = send(7, verb::delegate, 1s, [&](double fraction, std::string_view body) {
        reports.push_back(std::to_string(static_cast<int>(fraction * 100)) + " " + std::string{body});
    });
    BOOST_TEST(link.take() == "DELEGATE car2:speed id=7 deadline=1000 progress=yes\n");
    link.ask("id=7 progress=0 {}");
    link.ask("id=7 progress=0.5 {\"at\":\"x\"}");
    link.ask("id=7 progress=1 {}");
    BOOST_TEST(!result->ended);
    link.ask("id=7 {\"done\":true}");
    BOOST_TEST(result->text == "{\"done\":true}");
    const std::vector<std::string> expected{"0 {}", "50 {\"at\":\"x\"}", "100 {}"};
    BOOST_TEST(reports == expected, boost::test_tools::per_element());
    BOOST_TEST(dropped() == 0U);
}

BOOST_AUTO_TEST_CASE(progress_does_not_move_the_deadline) {
    const auto result = send(7, verb::delegate, 200ms, [](double, std::string_view) {});
    node.pass(150ms);
    link.ask("id=7 progress=0.9 {}");
    node.pass(50ms);
    BOOST_TEST((result->code == errc::deadline));
}

BOOST_AUTO_TEST_CASE(unrequested_or_malformed_progress_is_dropped) {
    int reports = 0;
    const auto quiet = send(7);
    const auto loud = send(8, verb::delegate, 1s, [&](double, std::string_view) { ++reports; });
    link.ask("id=7 progress=0.5 {}");
    link.ask("id=8 progress=0.5 {\"a\":");
    BOOST_TEST(dropped() == 2U);
    BOOST_TEST(reports == 0);
    BOOST_TEST(!quiet->ended);
    BOOST_TEST(!loud->ended);
}

BOOST_AUTO_TEST_CASE(cancelling_notifies_the_peer_and_completes_at_once) {
    const auto result = send(7, verb::delegate);
    link.take();
    BOOST_TEST(link.session().asking().cancel(7));
    BOOST_TEST(link.take() == "PUSH self:cles/cancel/7 reply=no\n");
    BOOST_TEST((result->code == errc::cancelled));
    BOOST_TEST(!link.session().asking().cancel(7));
    BOOST_TEST(link.take().empty());
    link.ask("id=7 {\"error\":\"cancelled\",\"message\":\"x\"}");
    BOOST_TEST(dropped() == 1U);
}

BOOST_AUTO_TEST_CASE(a_progress_callback_may_cancel_its_own_request) {
    std::shared_ptr<outcome> result;
    result = send(7, verb::delegate, 1s, [&](double, std::string_view) { link.session().asking().cancel(7); });
    link.ask("id=7 progress=0.5 {}");
    BOOST_TEST((result->code == errc::cancelled));
    BOOST_TEST(in_flight() == 0U);
}

BOOST_AUTO_TEST_CASE(requests_in_flight_when_the_link_is_lost_are_unavailable_at_once) {
    const auto seven = send(7);
    const auto eight = send(8, verb::delegate);
    link.reset();
    BOOST_TEST((seven->code == errc::unavailable));
    BOOST_TEST((eight->code == errc::unavailable));
    BOOST_TEST(seven->text == "the link was lost");
    BOOST_TEST(node.host->deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(requests_in_flight_when_the_peer_ends_its_stream_are_unavailable) {
    const auto result = send(7);
    link.half_close();
    BOOST_TEST((result->code == errc::unavailable));
}

BOOST_AUTO_TEST_CASE(a_reply_over_the_limit_fails_its_request_and_the_link_ends) {
    const auto seven = send(7);
    const auto eight = send(8);
    link.take();
    link.overlong("id=7 {\"a\":\"xxxx");
    BOOST_TEST((seven->code == errc::too_large));
    BOOST_TEST(!eight->ended);
    BOOST_TEST(link.take().empty()); // a reply is never answered
    BOOST_TEST(link.finishes == 1);
    link.reset();
    BOOST_TEST((eight->code == errc::unavailable));
}

// Nodes that forward do not send it to another node.
BOOST_AUTO_TEST_CASE(a_reply_over_the_limit_says_that_the_handler_has_run) {
    cles::core::subrequest_failure found{.may_have_started = false};
    auto operation = cles::detail::pending_ptr{
        new cles::core::subrequest([&](std::string_view, cles::core::subrequest_failure* why) { found = *why; })};
    link.session().asking().send({.verb = verb::delegate, .noun = "car2:work", .id = 7}, node.clock.now() + 5s,
                                 node.clock.now(), std::move(operation));
    link.overlong("id=7 {\"a\":\"xxxx");
    BOOST_TEST(found.may_have_started);
    BOOST_TEST(found.reported.ran);
    BOOST_TEST((found.reported.code == errc::too_large));
}

BOOST_AUTO_TEST_CASE(requests_pending_at_stop_complete_through_the_queue_with_their_progress_callback) {
    std::vector<cles::core::completion> due;
    cles::test::test_node stopping{{}, {}, {}, [&](cles::core::completion c) { due.push_back(std::move(c)); }};
    cles::test::test_link to{stopping};
    auto [operation, result] = cles::test::record();
    auto kept = std::make_shared<int>(0);
    const std::weak_ptr<int> report{kept};
    const auto now = stopping.clock.now();
    to.session().asking().send({.verb = verb::pull, .noun = "car2:speed", .id = 1}, now + 1s, now, std::move(operation),
                               [kept = std::move(kept)](double, std::string_view) {});
    to.session().asking().stop();
    BOOST_TEST(to.session().asking().in_flight() == 0U);
    BOOST_TEST(stopping.host->deadlines.size() == 0U);
    BOOST_TEST(!result->ended);
    BOOST_TEST(!report.expired());
    BOOST_REQUIRE(due.size() == 1U);
    due.front()();
    BOOST_TEST((result->code == errc::stopped));
    due.clear();
    BOOST_TEST(report.expired());
}

BOOST_AUTO_TEST_CASE(destroying_a_session_discards_pending_requests) {
    std::shared_ptr<outcome> result;
    {
        cles::test::test_link other{node};
        result = send_on(other, node, {.verb = verb::pull, .noun = "car2:speed", .id = 1}, 1s);
    }
    BOOST_TEST(!result->ended);
    BOOST_TEST(result->discarded);
    BOOST_TEST(node.host->deadlines.size() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
