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

// -- what the peer reads -------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_request_that_the_peer_would_not_read_is_refused_by_its_limit) {
    link.session().asking().release("car2", 300);
    const auto push = [&](std::uint64_t id, std::size_t size) {
        const std::string head = "PUSH car2:speed id=1 ";
        return send_on(
            link, node,
            {.verb = verb::push, .noun = "car2:speed", .id = id, .body = std::string(size - head.size(), '1')});
    };
    const auto just_fits = push(1, 300);
    BOOST_TEST(link.take().size() == 301U);
    const auto too_long = push(2, 301);
    node.pass(0ms);
    BOOST_TEST((too_long->code == errc::too_large));
    BOOST_TEST(too_long->text == "car2 reads requests of at most 300 bytes (its limits.line)");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(!just_fits->ended);
}

BOOST_AUTO_TEST_CASE(the_own_limit_holds_where_the_peer_reads_more) {
    link.session().asking().release("car2", std::size_t{1} << 40U);
    const std::string body(node.host->bounds.line, '1');
    const auto too_long = send_on(link, node, {.verb = verb::push, .noun = "car2:speed", .id = 2, .body = body});
    node.pass(0ms);
    BOOST_TEST((too_long->code == errc::too_large));
    BOOST_TEST(too_long->text == "a request has at most 1048576 bytes (limits.line)");
}

struct held_request : fixture {
    std::shared_ptr<outcome> push(std::uint64_t id, std::size_t size, verb v = verb::push) {
        return send_on(link, node, {.verb = v, .noun = "car2:speed", .id = id, .body = std::string(size, '1')}, 1s);
    }
};

// Short ones lose no time: every node reads them.
BOOST_FIXTURE_TEST_CASE(until_the_peer_has_said_what_it_reads_long_requests_wait_and_keep_their_order, held_request) {
    link.session().asking().hold();
    push(1, 10);
    BOOST_TEST(link.take() == "PUSH car2:speed id=1 deadline=1000 1111111111\n");
    push(2, 300);
    const auto longest = push(3, 500);
    push(4, 10);
    BOOST_TEST(link.take() == "");
    BOOST_TEST(in_flight() == 4U);
    link.session().asking().release("car2", 400);
    node.pass(0ms);
    BOOST_TEST(link.take() == "PUSH car2:speed id=2 deadline=1000 " + std::string(300, '1') +
                                  "\nPUSH car2:speed id=4 deadline=1000 1111111111\n");
    BOOST_TEST((longest->code == errc::too_large));
    push(5, 300);
    BOOST_TEST(link.take().starts_with("PUSH car2:speed id=5 "));
}

BOOST_FIXTURE_TEST_CASE(a_peer_that_does_not_say_what_it_reads_gets_everything, held_request) {
    link.session().asking().hold();
    push(1, 5000);
    link.session().asking().release();
    BOOST_TEST(link.take().starts_with("PUSH car2:speed id=1 "));
}

BOOST_FIXTURE_TEST_CASE(a_request_that_waits_ends_like_others_and_leaves_nothing_at_the_peer, held_request) {
    link.session().asking().hold();
    const auto cancelled = push(1, 300, verb::delegate);
    const auto late = push(2, 300, verb::delegate);
    BOOST_TEST(link.session().asking().cancel(1));
    BOOST_TEST((cancelled->code == errc::cancelled));
    node.pass(1s);
    BOOST_TEST((late->code == errc::deadline));
    BOOST_TEST(link.session().asking().held_bytes() == 0U);
    link.session().asking().release("car2", 4096);
    BOOST_TEST(link.take() == "");
    link.session().asking().hold();
    const auto lost = push(3, 300);
    BOOST_TEST(link.session().asking().held_bytes() > 300U);
    link.reset();
    BOOST_TEST((lost->code == errc::unavailable));
    BOOST_TEST(link.session().asking().held_bytes() == 0U);
}

BOOST_FIXTURE_TEST_CASE(what_the_peer_says_of_a_request_that_it_has_not_got_does_not_count, held_request) {
    auto& asking = link.session().asking();
    asking.hold();
    const auto waits = push(1, 300);
    const auto held = asking.held_bytes();
    link.ask("id=1 progress=0.5 {}");
    link.ask("id=1 {}");
    link.ask(R"(id=1 {"error":"failed","message":"car2: no"})");
    BOOST_TEST(!waits->ended);
    BOOST_TEST(dropped() == 3U);
    BOOST_TEST(asking.held_bytes() == held);
    asking.release();
    BOOST_TEST(asking.held_bytes() == 0U);
    BOOST_TEST(link.take().starts_with("PUSH car2:speed id=1 "));
    link.ask("id=1 {}");
    BOOST_TEST(waits->ended);
}

BOOST_AUTO_TEST_CASE(memory_for_requests_that_wait_is_limited) {
    cles::test::test_node small{{.line = 40'000, .memory = 65'536}};
    cles::test::test_link to{small};
    to.session().asking().hold();
    std::vector<std::shared_ptr<outcome>> all;
    for (std::uint64_t id = 1; id <= 10; ++id) {
        all.push_back(
            send_on(to, small, {.verb = verb::push, .noun = "car2:speed", .id = id, .body = std::string(10'000, '1')}));
    }
    small.pass(0ms);
    BOOST_TEST(!all.front()->ended);
    BOOST_TEST((all.back()->code == errc::busy));
}

// -- a peer that ends the link because of a long line --------------------------------------------------------------

BOOST_AUTO_TEST_CASE(who_has_not_cancelled_is_not_told_so_because_anothers_request_was_too_long) {
    const auto too_long = send(1);
    const auto two = send(2, verb::delegate, 30s);
    const auto three = send(3);
    link.ask(R"(id=1 {"error":"too_large","message":"car2: a line has at most 300 bytes"})");
    BOOST_TEST((too_long->code == errc::too_large));
    link.ask(R"(id=2 {"error":"cancelled","message":"car2: the requester cancelled it"})");
    BOOST_TEST((two->code == errc::unavailable));
    BOOST_TEST(two->text.find("limits.line") != std::string::npos, two->text);
    link.ask(R"(id=3 {"error":"cancelled","message":"car2: the requester cancelled it"})");
    BOOST_TEST((three->code == errc::unavailable));
}

BOOST_AUTO_TEST_CASE(that_holds_if_the_long_request_has_ended_before) {
    send(1);
    const auto two = send(2);
    link.session().asking().cancel(1);
    link.ask(R"(id=1 {"error":"too_large","message":"car2: a line has at most 300 bytes"})");
    link.ask(R"(id=2 {"error":"cancelled","message":"car2: the requester cancelled it"})");
    BOOST_TEST((two->code == errc::unavailable));
}

BOOST_AUTO_TEST_CASE(what_a_handler_calls_cancelled_stays_so) {
    send(1);
    const auto two = send(2);
    const auto three = send(3);
    link.ask(R"(id=1 {"error":"too_large","message":"car2: the result is too long","ran":true})");
    link.ask(R"(id=2 {"error":"cancelled","message":"car2: no"})");
    BOOST_TEST((two->code == errc::cancelled));
    send(4);
    send(5);
    link.ask(R"(id=4 {"error":"too_large","message":"car2: no"})");
    link.ask("id=5 {}"); // the link goes on
    link.ask(R"(id=3 {"error":"cancelled","message":"car2: no"})");
    BOOST_TEST((three->code == errc::cancelled));
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

BOOST_AUTO_TEST_CASE(a_forwarded_request_whose_deadline_passes_is_cancelled_at_the_peer) {
    for (const auto v : {verb::pull, verb::push, verb::delegate}) {
        send_on(link, node, {.verb = v, .noun = "car2:speed", .id = 7, .adverbs = "hops=7 via=car1"}, 200ms);
        link.take();
        node.pass(200ms);
        BOOST_TEST(link.take() == "PUSH self:cles/cancel/7 reply=no\n");
    }
    send_on(link, node, {.verb = verb::pull, .noun = "car2:speed", .id = 8, .adverbs = "hops=7 via=car1"}, 200ms);
    link.ask("id=8 {}");
    link.take();
    node.pass(200ms);
    BOOST_TEST(link.take() == "");
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
