// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/tracing.hpp>

#include "node/tracing/span_log.hpp"
#include "support/recorded_reply.hpp"
#include "support/routing_fixture.hpp"
#include "support/session_fixture.hpp"

#include <boost/json.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace span_log {
namespace {

namespace json = boost::json;
namespace protocol = cles::protocol;
using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

constexpr std::string_view trace_text = "4bf92f3577b34da6a3ce929d0e0e4736";
const std::string adverb = " trace=00-" + std::string{trace_text} + "-00f067aa0ba902b7-01";

/// The recorder alone.
struct recorder_fixture {
    static protocol::trace_context trace(std::uint64_t low = 1) {
        return {.id = {.high = 7, .low = low}, .span = 0xab, .sampled = true};
    }
    protocol::trace_context receive(std::uint64_t low = 1) {
        protocol::request_line r;
        protocol::malformed_request wrong;
        protocol::parse_request("DELEGATE any:plan/3 {}", r, wrong);
        r.trace = trace(low);
        return log->receive(r, clock.now(), clock.now());
    }
    json::array spans(std::uint64_t low = 1) {
        std::string text;
        cles::json_writer w{text};
        log->write(w, {.high = 7, .low = low}, clock.now());
        return json::parse(text).at("spans").as_array();
    }

    cles::test::manual_clock clock;
    std::shared_ptr<cles::core::span_log> log = std::make_shared<cles::core::span_log>("car1", clock, 42);
};

/// A node that records.
struct node_fixture {
    json::array spans() {
        link.take(); // earlier replies
        const auto reply = link.ask("PULL self:cles/trace/" + std::string{trace_text} + " id=99");
        return json::parse(reply.substr(reply.find('{'))).at("spans").as_array();
    }

    cles::test::test_node node{{}, {}, {}, {}, {}, cles::tracing()};
    cles::test::test_link link{node};
};

} // namespace
} // namespace span_log

BOOST_AUTO_TEST_SUITE(span_log)

BOOST_FIXTURE_TEST_CASE(a_received_request_has_a_span_until_its_reply, recorder_fixture) {
    const auto own = receive();
    BOOST_TEST(own.span != trace().span);
    BOOST_TEST((own.id == trace().id));
    clock.advance(3ms);
    auto all = spans();
    BOOST_REQUIRE(all.size() == 1U);
    BOOST_TEST(!all[0].as_object().contains("outcome")); // it runs
    log->add_times(own.span, 1ms, 2ms);
    log->end(own.span, "ok", clock.now());
    log->end(own.span, "failed", clock.now()); // has ended
    all = spans();
    BOOST_REQUIRE(all.size() == 1U);
    BOOST_TEST(json::serialize(all[0]) ==
               R"({"span":")" + std::string{json::value_to<std::string>(all[0].at("span"))} +
                   R"(","parent":"00000000000000ab","kind":"received","verb":"DELEGATE","target":"any","task":"plan",)"
                   R"("start_us":0,"queue_us":1000,"run_us":2000,"total_us":3000,"outcome":"ok"})");
    BOOST_TEST(spans(2).empty());
}

BOOST_FIXTURE_TEST_CASE(times_may_come_after_the_end, recorder_fixture) {
    const auto own = receive();
    log->end(own.span, "cancelled", clock.now());
    log->add_times(own.span, 5ms, 0ms);
    BOOST_TEST(spans()[0].at("queue_us").as_int64() == 5000);
    log->add_times(own.span + 1, 5ms, 0ms); // is not known
}

BOOST_FIXTURE_TEST_CASE(spans_are_forgotten_after_a_minute, recorder_fixture) {
    log->end(receive().span, "ok", clock.now());
    clock.advance(40s);
    log->end(receive().span, "ok", clock.now());
    const auto open = receive();
    clock.advance(20s);
    BOOST_TEST(spans().size() == 3U);
    clock.advance(1ms);
    BOOST_TEST(spans().size() == 2U);
    clock.advance(1h);
    BOOST_TEST(spans().size() == 1U); // has not ended
    log->end(open.span, "ok", clock.now());
    BOOST_TEST(log->open() == 0U);
}

BOOST_FIXTURE_TEST_CASE(the_number_of_spans_that_have_ended_is_limited, recorder_fixture) {
    constexpr auto most = cles::core::span_log::max_ended;
    for (std::size_t i = 0; i < most + 10; ++i) {
        log->end(receive(i + 1).span, "ok", clock.now());
    }
    BOOST_TEST(log->ended() == most);
    BOOST_TEST(spans(10).empty()); // the oldest ones are forgotten
    BOOST_TEST(spans(11).size() == 1U);
    BOOST_TEST(spans(most + 10).size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(beyond_the_limit_of_open_spans_none_is_recorded, recorder_fixture) {
    constexpr auto most = cles::core::span_log::max_open;
    std::vector<std::uint64_t> open;
    for (std::size_t i = 0; i < most; ++i) {
        open.push_back(receive().span);
    }
    const auto other = receive(2);
    BOOST_TEST(other.span == trace().span); // what it causes belongs to its sender
    BOOST_TEST(log->open() == most);
    BOOST_TEST(spans(2).empty());
    protocol::outgoing_request r{.noun = "car2:speed", .carried = {.trace = trace(2)}};
    auto [operation, result] = cles::test::record();
    auto* const before = operation.get();
    operation = log->send(r, {}, std::move(operation), clock.now());
    BOOST_TEST(operation.get() == before);
    BOOST_TEST(r.carried.trace.span == trace().span);
    log->end(open.front(), "ok", clock.now());
    BOOST_TEST(receive(2).span != trace().span);
}

BOOST_FIXTURE_TEST_CASE(a_sent_request_has_a_span_until_its_outcome, recorder_fixture) {
    const auto send = [&](std::string_view next) {
        auto recorded = cles::test::record();
        protocol::outgoing_request r{.verb = verb::push, .noun = "car2:speed/fast", .carried = {.trace = trace()}};
        recorded.operation = log->send(r, next, std::move(recorded.operation), clock.now());
        BOOST_TEST(r.carried.trace.span != trace().span);
        return recorded;
    };
    auto answered = send("");
    auto failed = send("car3");
    auto lost = send("");
    auto dropped = send("");
    clock.advance(2ms);
    BOOST_TEST((answered.operation->offer("{") == cles::detail::pending::verdict::malformed));
    BOOST_TEST(!spans()[0].as_object().contains("outcome"));
    BOOST_TEST((answered.operation.release()->offer("{}") == cles::detail::pending::verdict::completed));
    BOOST_TEST(answered.result->text == "{}");
    failed.operation.release()->refuse(errc::busy, "later", R"({"error":"busy"})");
    BOOST_TEST(failed.result->text == "later");
    lost.operation.release()->fail(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "no");
    dropped.operation.reset();
    BOOST_TEST(dropped.result->discarded);
    BOOST_TEST(log->open() == 0U);
    std::vector<std::string> outcomes;
    for (const auto& span : spans()) {
        BOOST_TEST(span.at("kind").as_string() == "sent");
        BOOST_TEST(span.at("target").as_string() == "car2");
        BOOST_TEST(span.at("task").as_string() == "speed");
        BOOST_TEST(!span.as_object().contains("queue_us"));
        outcomes.push_back(json::value_to<std::string>(span.at("outcome")) +
                           (span.as_object().contains("next") ? " by car3" : ""));
    }
    BOOST_TEST(outcomes == (std::vector<std::string>{"ok", "busy by car3", "unavailable", "cancelled"}),
               boost::test_tools::per_element());
}

// -- of a node -----------------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(a_request_that_is_answered_at_once, node_fixture) {
    std::string seen;
    node.on(verb::pull, "speed", [&](const cles::request& r, cles::json_writer& w) {
        seen = r.trace();
        node.clock.advance(4ms);
        w.raw("{}");
    });
    BOOST_TEST(link.ask("PULL car1:speed id=1" + adverb) == "id=1 {}\n");
    const auto all = spans();
    BOOST_REQUIRE(all.size() == 1U);
    BOOST_TEST(seen == "00-" + std::string{trace_text} + "-" + json::value_to<std::string>(all[0].at("span")) + "-01");
    BOOST_TEST(all[0].at("parent").as_string() == "00f067aa0ba902b7");
    BOOST_TEST(all[0].at("run_us").as_int64() == 4000);
    BOOST_TEST(all[0].at("total_us").as_int64() == 4000);
    BOOST_TEST(all[0].at("outcome").as_string() == "ok");
}

BOOST_FIXTURE_TEST_CASE(a_request_that_is_answered_later, node_fixture) {
    node.on_later(verb::pull, "slow");
    link.ask("PULL car1:slow/a" + adverb);
    link.ask("PULL car1:slow/b" + adverb); // waits for the first one
    node.pass(2ms);
    node.started[0]->call->done("{}");
    link.turn();
    node.pass(3ms);
    node.started[1]->call->fail({.code = errc::denied, .message = "no"});
    const auto all = spans();
    BOOST_REQUIRE(all.size() == 2U);
    BOOST_TEST(all[0].at("queue_us").as_int64() == 0);
    BOOST_TEST(all[0].at("run_us").as_int64() == 2000);
    BOOST_TEST(all[1].at("queue_us").as_int64() == 2000);
    BOOST_TEST(all[1].at("run_us").as_int64() == 3000);
    BOOST_TEST(all[1].at("total_us").as_int64() == 5000);
    BOOST_TEST(all[1].at("outcome").as_string() == "denied");
}

BOOST_FIXTURE_TEST_CASE(requests_that_are_refused_cancelled_or_lost, node_fixture) {
    node.on_later(verb::pull, "slow");
    link.ask("PULL car1:none id=1" + adverb);
    link.ask("PUSH car1:none reply=no" + adverb);
    link.ask("PULL car1:slow/a id=2 deadline=5" + adverb);
    link.ask("PULL car1:slow/b id=3" + adverb);
    link.ask("PUSH self:cles/cancel/3 reply=no");
    node.pass(10ms);
    {
        cles::test::test_link other{node};
        other.ask("PULL car1:slow/c id=4" + adverb);
        other.ask("PULL car1:slow/d" + adverb);
        other.reset();
    }
    std::vector<std::string> outcomes;
    for (const auto& span : spans()) {
        outcomes.push_back(json::value_to<std::string>(span.at("outcome")));
    }
    const std::vector<std::string> expected{"no_task", "no_task", "deadline", "cancelled", "cancelled", "cancelled"};
    std::sort(outcomes.begin(), outcomes.end());
    auto sorted = expected;
    std::sort(sorted.begin(), sorted.end());
    BOOST_TEST(outcomes == sorted, boost::test_tools::per_element());
}

BOOST_FIXTURE_TEST_CASE(without_the_flag_nothing_is_recorded, node_fixture) {
    std::string seen;
    node.on(verb::pull, "speed", [&](const cles::request& r, cles::json_writer& w) {
        seen = r.trace();
        w.raw("{}");
    });
    const auto trace = "00-" + std::string{trace_text} + "-00f067aa0ba902b7-00";
    link.ask("PULL car1:speed id=1 trace=" + trace);
    BOOST_TEST(seen == trace);
    BOOST_TEST(spans().empty());
    link.ask("PULL car1:speed id=1");
    BOOST_TEST(seen.empty());
}

BOOST_FIXTURE_TEST_CASE(the_reserved_noun, node_fixture) {
    BOOST_TEST(link.kind("PULL self:cles/trace/" + std::string{trace_text}) == "ok");
    for (const auto* const wrong : {"4bf9", "4BF92F3577B34DA6A3CE929D0E0E4736", "00000000000000000000000000000000"}) {
        BOOST_TEST(link.kind("PULL self:cles/trace/" + std::string{wrong}) == "bad_request", wrong);
    }
    BOOST_TEST(link.kind("PULL self:cles/trace") == "no_task");
    BOOST_TEST(link.kind("PUSH self:cles/trace/" + std::string{trace_text}) == "no_task");
    BOOST_TEST(link.ask("PULL self:cles").find(R"("features":["mark","trace"])") != std::string::npos);
    cles::test::test_node plain;
    cles::test::test_link to_plain{plain};
    BOOST_TEST(to_plain.kind("PULL self:cles/trace/" + std::string{trace_text}) == "no_task");
}

BOOST_FIXTURE_TEST_CASE(messages_of_handlers_bear_the_trace, cles::test::routing_fixture) {
    std::vector<std::string> traces;
    cles::test::test_node logging{
        {}, {}, [&](cles::log_level, const cles::log_entry& entry) { traces.emplace_back(entry.trace); }};
    logging.on_later(verb::pull, "slow");
    cles::test::test_link client{logging};
    client.ask("PULL car1:slow id=1" + adverb);
    client.ask("PULL car1:slow id=2");
    logging.started[0]->call->write_log(cles::log_level::info, "hello");
    logging.started[1]->call->write_log(cles::log_level::info, "hello");
    BOOST_TEST(traces == (std::vector<std::string>{std::string{trace_text}, ""}), boost::test_tools::per_element());
}

BOOST_FIXTURE_TEST_CASE(a_forwarded_request_carries_the_trace, cles::test::routing_fixture) {
    link.ask("PULL car2:speed id=7 colour=red" + adverb + " trace=x");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1 colour=red");
    BOOST_TEST(protocol::traceparent_text(ways.to("car2").carried.trace) == adverb.substr(7));
    link.ask("PULL car2:speed id=8 trace=00-4bf9-01");
    BOOST_TEST(!ways.to("car2").carried.trace);
}

BOOST_AUTO_TEST_SUITE_END()
