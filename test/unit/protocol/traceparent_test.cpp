// SPDX-License-Identifier: BSL-1.0
#include "protocol/request_line.hpp"
#include "protocol/traceparent.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

BOOST_AUTO_TEST_SUITE(traceparent)

namespace protocol = cles::protocol;

namespace {

// The example of the specification.
constexpr std::string_view example = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

protocol::request_line parsed(const std::string& line) {
    protocol::request_line r;
    protocol::malformed_request wrong;
    BOOST_TEST(protocol::parse_request(line, r, wrong), line + ": " + wrong.why);
    return r;
}

} // namespace

BOOST_AUTO_TEST_CASE(a_valid_one_is_read_and_written) {
    const auto trace = protocol::parse_traceparent(example);
    BOOST_REQUIRE(trace.has_value());
    BOOST_TEST(trace->id.high == 0x4bf92f3577b34da6U);
    BOOST_TEST(trace->id.low == 0xa3ce929d0e0e4736U);
    BOOST_TEST(trace->span == 0x00f067aa0ba902b7U);
    BOOST_TEST(trace->sampled);
    BOOST_TEST(static_cast<bool>(*trace));
    BOOST_TEST(protocol::traceparent_text(*trace) == example);
    BOOST_TEST(protocol::trace_id_text(trace->id) == "4bf92f3577b34da6a3ce929d0e0e4736");
}

BOOST_AUTO_TEST_CASE(only_the_lowest_flag_counts) {
    const std::string before{example.substr(0, example.size() - 2)};
    for (const auto* const flags : {"00", "02", "fe"}) {
        BOOST_TEST(!protocol::parse_traceparent(before + flags).value().sampled, flags);
    }
    for (const auto* const flags : {"03", "ff"}) {
        const auto trace = protocol::parse_traceparent(before + flags).value();
        BOOST_TEST(trace.sampled, flags);
        BOOST_TEST(protocol::traceparent_text(trace) == example); // others are not passed on
    }
    BOOST_TEST(protocol::traceparent_text(protocol::parse_traceparent(before + "02").value()) == before + "00");
}

BOOST_AUTO_TEST_CASE(another_form_is_not_valid) {
    const std::string valid{example};
    BOOST_TEST(!protocol::parse_traceparent(""));
    BOOST_TEST(!protocol::parse_traceparent("4bf92f3577b34da6"));
    BOOST_TEST(!protocol::parse_traceparent("00-4bf9-01"));
    for (std::size_t length = 0; length < valid.size(); ++length) {
        BOOST_TEST(!protocol::parse_traceparent(valid.substr(0, length)), length);
    }
    for (std::size_t i = 0; i < valid.size(); ++i) {
        for (const char other : {'-', 'G', 'A', ' ', '_'}) {
            auto text = valid;
            text[i] = other;
            const bool same = other == valid[i];
            BOOST_TEST(protocol::parse_traceparent(text).has_value() == same, text);
        }
    }
}

BOOST_AUTO_TEST_CASE(ids_of_zeros_are_not_valid) {
    BOOST_TEST(!protocol::parse_traceparent("00-00000000000000000000000000000000-00f067aa0ba902b7-01"));
    BOOST_TEST(!protocol::parse_traceparent("00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01"));
    BOOST_TEST(!protocol::parse_trace_id("00000000000000000000000000000000"));
    BOOST_TEST(protocol::parse_trace_id("00000000000000000000000000000001").has_value());
    BOOST_TEST(!protocol::parse_trace_id("1"));
}

BOOST_AUTO_TEST_CASE(what_a_later_version_appends_is_ignored) {
    const std::string rest{example.substr(2)};
    BOOST_TEST(!protocol::parse_traceparent("00" + rest + "-more"));
    BOOST_TEST(protocol::traceparent_text(protocol::parse_traceparent("01" + rest).value()) == example);
    BOOST_TEST(protocol::traceparent_text(protocol::parse_traceparent("cc" + rest + "-more").value()) == example);
    BOOST_TEST(!protocol::parse_traceparent("cc" + rest + ".more"));
    BOOST_TEST(!protocol::parse_traceparent("cc" + rest + "00"));
    BOOST_TEST(!protocol::parse_traceparent("ff" + rest));
}

BOOST_AUTO_TEST_CASE(every_request_may_have_one) {
    for (const std::string line :
         {"PULL car1:speed", "PUSH car1:speed", "DELEGATE car1:work", "BIND car1:speed", "UPDATE car1:speed"}) {
        const auto text = line + " trace=" + std::string{example};
        BOOST_TEST(protocol::traceparent_text(parsed(text).trace) == example);
        BOOST_TEST(!parsed(line).trace);
    }
}

BOOST_AUTO_TEST_CASE(another_value_is_ignored) {
    BOOST_TEST(!parsed("PULL car1:speed trace=4bf92f3577b34da6").trace);
    BOOST_TEST(!parsed("PULL car1:speed trace=x").trace);
    const auto line = "PULL car1:speed trace=x trace=" + std::string{example};
    BOOST_TEST(protocol::traceparent_text(parsed(line).trace) == example);
    BOOST_TEST(protocol::traceparent_text(parsed(line + " trace=y").trace) == example);
}

BOOST_AUTO_TEST_CASE(it_is_written_with_a_request) {
    std::string line;
    protocol::append_request(line, {.noun = "car1:speed", .carried = {.trace = *protocol::parse_traceparent(example)}});
    BOOST_TEST(line == "PULL car1:speed trace=" + std::string{example} + "\n");
}

BOOST_AUTO_TEST_CASE(a_copy_of_a_request_keeps_the_span_of_this_node) {
    const auto line = "PULL car1:speed trace=" + std::string{example};
    auto r = parsed(line);
    r.trace.span = 7;
    const protocol::owned_request copy{r};
    BOOST_TEST(copy->trace.span == 7U);
    BOOST_TEST((copy->trace.id == r.trace.id));
}

BOOST_AUTO_TEST_SUITE_END()
