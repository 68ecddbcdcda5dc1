// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/json_reader.hpp>

#include "gateway/told/spans.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace spans {
namespace {

constexpr std::int64_t ms = 1'000'000; // in ns

std::string id(char digit) { return std::string(16, digit); }

tool::span_document span(std::string kind, char own, char parent, double start_us, double total_us) {
    tool::span_document made;
    made.span = id(own);
    made.parent = id(parent);
    made.kind = std::move(kind);
    made.verb = "PULL";
    made.target = "car1";
    made.task = "speed";
    made.start_us = start_us;
    made.total_us = total_us;
    made.outcome = "ok";
    return made;
}

/// The span of the request at the gateway: 10 ms from the second 1.
gateway::placed_span root() {
    return {.node = "gateway",
            .id = id('1'),
            .parent = {},
            .name = "PULL car1:speed",
            .is_client = false,
            .start_ns = 1000 * ms,
            .end_ns = 1010 * ms,
            .outcome = "ok"};
}

} // namespace
} // namespace spans

BOOST_AUTO_TEST_SUITE(spans)

BOOST_AUTO_TEST_CASE(a_trace_parent_is_read) {
    const std::string text = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";
    const auto parent = gateway::parse_trace_parent(text);
    BOOST_TEST(parent.trace == "0af7651916cd43dd8448eb211c80319c");
    BOOST_TEST(parent.span == "b7ad6b7169203331");
    BOOST_TEST(parent.is_sampled);
    BOOST_TEST(gateway::to_text(parent) == text);
    BOOST_TEST(!gateway::parse_trace_parent("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-00").is_sampled);
    for (const auto* const wrong : {"", "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331",
                                    "01-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01",
                                    "00-00000000000000000000000000000000-b7ad6b7169203331-01",
                                    "00-0af7651916cd43dd8448eb211c80319c-0000000000000000-01",
                                    "00-0AF7651916CD43DD8448EB211C80319C-b7ad6b7169203331-01",
                                    "00-0af7651916cd43dd8448eb211c80319c b7ad6b7169203331-01"}) {
        BOOST_TEST(gateway::parse_trace_parent(wrong).trace == "", wrong);
    }
}

// The clock of car1 says something else altogether.
BOOST_AUTO_TEST_CASE(spans_are_placed_by_the_clock_of_the_gateway) {
    const std::vector<tool::trace_document> nodes{
        {.node = "gateway", .spans = {spans::span("sent", '2', '1', 0, 8'000)}},
        {.node = "car1",
         .spans = {spans::span("received", '3', '2', 77, 4'000), spans::span("sent", '4', '3', 1'077, 500)}}};
    const auto placed = gateway::place_spans(spans::root(), nodes);
    BOOST_TEST_REQUIRE(placed.size() == 3U);
    BOOST_TEST(placed[0].id == id('2'));
    BOOST_TEST(placed[0].is_client);
    BOOST_TEST(placed[0].end_ns - placed[0].start_ns == 8 * ms);
    BOOST_TEST(placed[1].id == id('3'));
    BOOST_TEST(placed[1].node == "car1");
    BOOST_TEST(!placed[1].is_client);
    BOOST_TEST(placed[1].start_ns - placed[0].start_ns == 2 * ms); // in the middle of the time of its sender
    BOOST_TEST(placed[1].end_ns - placed[1].start_ns == 4 * ms);
    BOOST_TEST(placed[2].start_ns - placed[1].start_ns == 1 * ms); // by the clock of its own node
}

BOOST_AUTO_TEST_CASE(what_nodes_tell_may_be_anything) {
    constexpr auto infinite = std::numeric_limits<double>::infinity();
    auto odd = spans::span("received", '3', '2', -infinite, infinite);
    auto loop = spans::span("sent", '2', '3', 0, 1e300);
    auto stranger = spans::span("sent", '6', '5', 0, 1);
    auto nameless = spans::span("sent", '7', '1', 0, 1);
    nameless.span = "\"}";
    auto endless = spans::span("sent", '8', '1', 0, 1);
    endless.task = std::string(1'000'000, 'a');
    const std::vector<tool::trace_document> nodes{
        {.node = "gateway", .spans = {spans::span("sent", '2', '1', 0, 1), nameless, endless}},
        {.node = "car1", .spans = {odd, odd, loop, stranger}}};
    const auto placed = gateway::place_spans(spans::root(), nodes);
    BOOST_TEST(placed.size() <= 4U);
    for (const auto& each : placed) {
        BOOST_TEST((each.id != id('6') && each.id != id('8')));
        BOOST_TEST(each.start_ns >= 1000 * ms);
        BOOST_TEST(each.end_ns >= each.start_ns);
    }
}

BOOST_AUTO_TEST_CASE(what_one_node_tells_is_limited) {
    auto long_name = spans::span("sent", '2', '1', 0, 1);
    long_name.target = std::string(257, 'a');
    tool::trace_document told{.node = "car1", .spans = {long_name}};
    for (int i = 0; i < 1000; ++i) {
        told.spans.push_back(spans::span("sent", '2', '1', 0, 1));
        told.spans.back().target = "car" + std::to_string(i);
    }
    const auto read = gateway::read_trace(cles::to_json(told));
    BOOST_TEST(read.node == "car1");
    BOOST_TEST_REQUIRE(read.spans.size() == 256U);
    BOOST_TEST(read.spans[0].target == "car0");
    std::vector<std::string> names{"self", "car1"};
    gateway::add_nodes(read, names, 32);
    BOOST_TEST(names.size() == 32U);
    BOOST_TEST(std::count(names.begin(), names.end(), "car1") == 1);
    BOOST_CHECK_THROW(gateway::read_trace("[]"), cles::error);
}

BOOST_AUTO_TEST_CASE(the_nodes_that_were_asked_are_found) {
    auto through = spans::span("sent", '2', '1', 0, 1);
    through.next = "gate";
    auto any = spans::span("sent", '3', '1', 0, 1);
    any.target = "any";
    auto received = spans::span("received", '4', '1', 0, 1);
    received.target = "car9";
    std::vector<std::string> names{"self"};
    gateway::add_nodes({.node = "car1", .spans = {through, any, received, through}}, names, 32);
    BOOST_TEST(names == (std::vector<std::string>{"self", "gate", "car1"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_collector_gets_them_by_node) {
    auto failed = spans::root();
    failed.id = id('2');
    failed.parent = id('1');
    failed.node = "car\"1";
    failed.is_client = true;
    failed.outcome = "busy";
    const std::string trace(32, 'a');
    const auto document =
        gateway::otlp_document({{.trace = trace, .span = spans::root()}, {.trace = trace, .span = failed}});
    BOOST_TEST(cles::is_valid_json(document));
    for (const auto* const part :
         {R"({"resource":{"attributes":[{"key":"service.name","value":{"stringValue":"gateway"}}]})",
          R"("stringValue":"car\"1")",
          R"("traceId":"aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa","spanId":"1111111111111111","name")",
          R"("parentSpanId":"1111111111111111")",
          R"("kind":2,"startTimeUnixNano":"1000000000","endTimeUnixNano":"1010000000")", R"("kind":3)",
          R"("status":{"code":1})", R"("status":{"code":2})",
          R"({"key":"cles.outcome","value":{"stringValue":"busy"}})"}) {
        BOOST_TEST(document.find(part) != std::string::npos, part);
    }
}

BOOST_AUTO_TEST_SUITE_END()
