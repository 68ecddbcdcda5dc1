// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace inbound_limits {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    explicit fixture(cles::limits bounds = {}) : node(bounds) {
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on_later(verb::delegate, "work");
        node.open("pose");
    }
    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace inbound_limits

BOOST_FIXTURE_TEST_SUITE(inbound_limits, fixture)

BOOST_AUTO_TEST_CASE(the_defaults_are_those_of_the_documentation) {
    const cles::limits defaults;
    BOOST_TEST(defaults.line == 1'048'576U);
    BOOST_TEST(defaults.depth == 32U);
    BOOST_TEST(defaults.links == 1024U);
    BOOST_TEST(defaults.in_flight == 4096U);
    BOOST_TEST(defaults.bindings == 1024U);
    BOOST_TEST(defaults.nouns == 4096U);
    BOOST_TEST(defaults.unread == 1'048'576U);
    BOOST_TEST(defaults.binding_bytes == 4'194'304U);
    BOOST_CHECK(defaults.stall == 30s);
    BOOST_CHECK(defaults.discard == 1s);
}

BOOST_AUTO_TEST_CASE(the_4097th_request_in_flight_on_a_link_is_busy) {
    for (int id = 1; id <= 4096; ++id) {
        link.ask("DELEGATE car1:work id=" + std::to_string(id));
    }
    BOOST_TEST(node.started.size() == 4096U);
    const auto more = link.reply("DELEGATE car1:work id=4097");
    BOOST_TEST(more.error == "busy");
    BOOST_TEST(more.id == 4097U);
    BOOST_TEST(more.retry_ms.value_or(0) > 0U);
    BOOST_TEST(link.kind("PULL car1:speed") == "busy");
    cles::test::test_link other{node};
    BOOST_TEST(other.kind("PULL car1:speed") == "ok"); // the limit applies to one link
    node.started.at(17)->call->done("[1]");
    link.take();
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
}

BOOST_AUTO_TEST_CASE(an_unbind_is_served_beyond_the_limit) {
    fixture small{cles::limits{.in_flight = 1}};
    BOOST_TEST(small.link.kind("BIND car1:pose id=1") == "id=1 ok");
    small.link.ask("DELEGATE car1:work id=2");
    BOOST_TEST(small.link.kind("BIND car1:pose/left id=3") == "id=3 busy");
    BOOST_TEST(small.link.kind("BIND car1:pose id=4 lease=0") == "id=4 ok"); // a feed closes once, and does not retry
    BOOST_TEST(small.link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(waiting_requests_count_as_in_flight_and_are_refused_in_order) {
    fixture small{cles::limits{.in_flight = 3}};
    auto& to = small.link;
    to.ask("DELEGATE car1:work");
    to.ask("PULL car1:speed");
    to.ask("PULL car1:speed");
    BOOST_TEST(to.ask("PULL car1:speed").empty()); // the fourth in flight
    BOOST_TEST(to.kind("PULL car1:speed id=7") == "id=7 busy");
    small.node.started.at(0)->call->done("[1]");
    BOOST_TEST(to.sent() == "ok, ok, ok, busy");
    BOOST_TEST(to.kind("PULL car1:speed") == "ok");
}

BOOST_AUTO_TEST_CASE(a_refused_request_with_reply_no_is_counted) {
    fixture small{cles::limits{.in_flight = 1}};
    small.node.on(verb::push, "log", std::string{});
    small.link.ask("DELEGATE car1:work");
    BOOST_TEST(small.link.ask("PUSH car1:log reply=no").empty());
    BOOST_TEST(small.link.ask("PUSH car1:log reply=no id=7").empty());
    BOOST_TEST(small.node.counts().errors_unsent == 2U);
    small.node.started.at(0)->call->done("[1]");
    BOOST_TEST(small.link.sent() == "ok");
}

BOOST_AUTO_TEST_CASE(the_1025th_binding_of_a_link_is_busy) {
    for (int i = 0; i < 1024; ++i) {
        link.ask("BIND car1:pose/" + std::to_string(i));
    }
    BOOST_TEST(link.session().serving().bindings() == 1024U);
    const auto more = link.reply("BIND car1:pose/more");
    BOOST_TEST(more.error == "busy");
    BOOST_TEST(more.retry_ms.value_or(0) > 0U);
    BOOST_TEST(link.kind("BIND car1:pose/5 every=10") == "ok"); // replacing a binding does not count
    cles::test::test_link other{node};
    BOOST_TEST(other.kind("BIND car1:pose/more") == "ok");
    link.ask("BIND car1:pose/5 lease=0");
    BOOST_TEST(link.kind("BIND car1:pose/more") == "ok");
}

BOOST_AUTO_TEST_CASE(the_4097th_noun_of_a_task_is_busy) {
    for (int i = 0; i < 4096; ++i) {
        node.publish("pose/" + std::to_string(i), "[1]");
    }
    const auto more = link.reply("BIND car1:pose/more");
    BOOST_TEST(more.error == "busy");
    BOOST_TEST(more.retry_ms.value_or(0) > 0U);
    BOOST_TEST(link.session().serving().bindings() == 0U);
    BOOST_TEST(link.kind("BIND car1:pose/4095") == "ok");
    node.open("load");
    BOOST_TEST(link.kind("BIND car1:load/more") == "ok"); // the limit applies to one task
}

BOOST_AUTO_TEST_CASE(nouns_that_were_only_bound_are_released) {
    fixture small{cles::limits{.nouns = 2}};
    for (int i = 0; i < 10; ++i) {
        cles::test::test_link brief{small.node};
        BOOST_TEST(brief.kind("BIND car1:pose/" + std::to_string(i)) == "ok");
        BOOST_TEST(brief.kind("BIND car1:pose/other") == "ok");
        if (i % 2 == 0) {
            brief.ask("BIND car1:pose/other lease=0");
        }
    }
    BOOST_TEST(small.link.kind("BIND car1:pose/last") == "ok");
}

BOOST_AUTO_TEST_CASE(running_handlers_are_limited_for_the_whole_node) {
    fixture small{cles::limits{.running = 2}};
    cles::test::test_link other{small.node};
    small.link.ask("DELEGATE car1:work id=1");
    other.ask("DELEGATE car1:work id=1");
    const auto more = other.reply("DELEGATE car1:work id=2");
    BOOST_TEST(more.error == "busy");
    BOOST_TEST(more.retry_ms.value_or(0) > 0U);
    BOOST_TEST(other.kind("PULL car1:speed") == "ok"); // a plain handler ends at once

    // A handler that was told to stop counts as running until it has released its call.
    small.link.ask("PUSH self:cles/cancel/1");
    BOOST_TEST(other.kind("DELEGATE car1:work id=2") == "id=2 busy");
    small.node.started.at(0).reset();
    BOOST_TEST(other.kind("DELEGATE car1:work id=2").empty());
}

BOOST_AUTO_TEST_CASE(reading_pauses_while_waiting_requests_take_too_much_memory) {
    fixture small{cles::limits{.waiting = 1000}};
    auto& to = small.link;
    to.ask("DELEGATE car1:work");
    const auto line = "DELEGATE car1:work/" + std::string(181, 'p'); // 200 bytes
    for (int i = 0; i < 5; ++i) {
        to.ask(line);
        BOOST_TEST(!to.paused);
    }
    to.ask(line);
    BOOST_TEST(to.paused);
    BOOST_TEST(to.pauses == 1);
    for (std::size_t done = 0; done < 3; ++done) { // 6 waiting requests become 3
        small.node.started.at(done)->call->done("[1]");
        to.turn();
        BOOST_TEST(to.paused);
    }
    small.node.started.at(3)->call->done("[1]");
    to.turn();
    BOOST_TEST(!to.paused);
    BOOST_TEST(to.pauses == 2);
}

BOOST_AUTO_TEST_CASE(reading_pauses_in_a_flood_of_malformed_lines) {
    link.ask("DELEGATE car1:work");
    int lines = 0;
    while (!link.paused && lines < 100'000) {
        link.ask("x");
        ++lines;
    }
    BOOST_TEST(link.paused);
    BOOST_TEST(lines < 20'000); // a megabyte of replies
    node.started.at(0)->call->done("[1]");
    std::size_t answers = 0;
    for (auto sent = link.take_lines(); !sent.empty(); sent = link.take_lines()) {
        answers += sent.size();
        link.serve_more();
    }
    BOOST_TEST(answers == static_cast<std::size_t>(lines) + 1);
    BOOST_TEST(!link.paused);
}

BOOST_AUTO_TEST_CASE(waiting_requests_are_served_in_batches) {
    node.on(verb::pull, "big", "[\"" + std::string(1000, 'x') + "\"]");
    link.ask("DELEGATE car1:work");
    for (int i = 0; i < 4000; ++i) {
        link.ask("PULL car1:big");
    }
    const auto wakes = link.wakes;
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.wakes > wakes);
    BOOST_TEST(link.session().serving().has_more());
    BOOST_TEST(link.output().size() < 100'000U);
    BOOST_TEST(link.kind("PULL car1:speed").ends_with("ok")); // waits after the others
    std::size_t answers = 0;
    std::string last;
    while (link.session().serving().has_more()) {
        link.serve_more();
        BOOST_TEST(link.output().size() < 100'000U);
        for (auto& line : link.take_lines()) {
            ++answers;
            last = std::move(line);
        }
    }
    BOOST_TEST(answers > 3900U);
    BOOST_TEST(last == "{\"v\":3}");
}

BOOST_AUTO_TEST_CASE(every_failure_of_the_node_names_it) {
    fixture small{cles::limits{.line = 300, .in_flight = 2, .bindings = 1, .nouns = 1, .running = 1}};
    auto& node = small.node;
    node.on(verb::pull, "large", "[\"" + std::string(400, 'x') + "\"]");
    node.on(verb::pull, "wrong", "{\"error\":1}");
    std::vector<std::string> messages;
    const auto note = [&](const std::vector<std::string>& lines) {
        for (const auto& line : lines) {
            if (const auto reply = cles::test::read_reply(line); !reply.error.empty()) {
                messages.push_back(reply.error + ": " + reply.message);
            }
        }
    };
    const auto ask = [&](cles::test::test_link& to, std::string_view line) {
        to.session().on_line(line, node.clock.now());
        note(to.take_lines());
    };
    ask(small.link, "FLY");
    ask(small.link, "PULL car9:speed");
    ask(small.link, "PULL car1:nothing");
    ask(small.link, "BIND car1:nothing");
    ask(small.link, "PULL self:cles/nothing");
    ask(small.link, "PUSH self:cles/cancel/0");
    ask(small.link, "PULL car1:large");
    ask(small.link, "PULL car1:wrong");
    ask(small.link, "BIND car1:pose");
    ask(small.link, "BIND car1:pose/more"); // too many bindings
    {
        cles::test::test_link other{node};
        ask(other, "BIND car1:pose/more"); // too many nouns
        ask(other, "DELEGATE car1:work id=1 deadline=100");
        ask(other, "DELEGATE car1:work id=2"); // too many handlers
        ask(other, "PUSH self:cles/cancel/1");
        node.started.clear();
        ask(other, "DELEGATE car1:work deadline=100");
        ask(other, "PULL car1:speed deadline=1");
        ask(other, "PULL car1:speed");
        ask(other, "PULL car1:speed id=3"); // too many in flight
        node.pass(100ms);
        note(other.take_lines());
        node.started.clear();
        ask(other, "DELEGATE car1:work id=1");
        ask(other, "DELEGATE car1:work id=1"); // in flight already
        node.started.clear();
    }
    small.link.overlong("PULL xxx");
    note(small.link.take_lines());
    BOOST_TEST(messages.size() >= 18U);
    node.on(verb::pull, "broken", [](const cles::request&, cles::json_writer&) { throw std::runtime_error{"off"}; });
    ask(small.link, "PULL car1:broken");
    for (const auto& message : messages) {
        BOOST_TEST(message.find("car1") != std::string::npos, message);
    }
}

BOOST_AUTO_TEST_SUITE_END()
