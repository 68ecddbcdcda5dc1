// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace inbound_order {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    fixture() {
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on(verb::push, "count", [this](const cles::request&, cles::json_writer& w) { w.value(++counted); });
        node.on_later(verb::delegate, "work");
        node.on_later(verb::pull, "slow");
        node.on_later(verb::push, "store");
    }
    cles::test::test_node::running& started(std::size_t i) { return *node.started.at(i); }
    void finish(std::size_t i, std::string_view json) {
        started(i).call->done(json);
        link.turn();
    }

    cles::test::test_node node;
    cles::test::test_link link{node};
    std::int64_t counted = 0;
};

} // namespace
} // namespace inbound_order

BOOST_FIXTURE_TEST_SUITE(inbound_order, fixture)

BOOST_AUTO_TEST_SUITE(without_id)

BOOST_AUTO_TEST_CASE(requests_without_id_run_one_after_another_and_are_answered_in_their_order) {
    link.ask("DELEGATE car1:work/a");
    link.ask("DELEGATE car1:work/b");
    link.ask("PULL car1:speed");
    BOOST_TEST(node.started.size() == 1U);
    BOOST_TEST(link.take().empty());
    finish(0, "[1]");
    BOOST_TEST(link.take() == "[1]\n");
    BOOST_REQUIRE_EQUAL(node.started.size(), 2U);
    BOOST_TEST(started(1).parameters.at(0) == "b");
    finish(1, "[2]");
    BOOST_TEST(link.take() == "[2]\n{\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(a_plain_handler_waits_its_turn_too) {
    link.ask("DELEGATE car1:work");
    link.ask("PUSH car1:count");
    BOOST_TEST(counted == 0);
    finish(0, "[1]");
    BOOST_TEST(counted == 1);
}

// A call may end while the library iterates over its deadlines, or over the data of another node. A handler that
// started there could change that container.
BOOST_AUTO_TEST_CASE(a_waiting_request_starts_in_a_later_pass_of_its_link) {
    for (const bool late : {false, true}) {
        fixture f;
        f.link.ask("DELEGATE car1:work deadline=100");
        f.link.ask("PUSH car1:count");
        f.link.ask("PULL car1:slow");
        const auto wakes = f.link.wakes;
        if (late) {
            f.node.pass(100ms);
        } else {
            f.started(0).call->done("[1]");
        }
        BOOST_TEST(f.counted == 0);
        BOOST_TEST(f.node.started.size() == 1U);
        BOOST_TEST(f.link.wakes > wakes);
        f.link.turn();
        BOOST_TEST(f.counted == 1);
        BOOST_TEST(f.node.started.size() == 2U);
        BOOST_TEST(f.link.sent() == (late ? "deadline, ok" : "ok, ok"));
    }
}

BOOST_AUTO_TEST_CASE(a_line_before_that_pass_waits_its_turn) {
    link.ask("DELEGATE car1:work");
    link.ask("PUSH car1:count");
    started(0).call->done("[1]");
    link.session().on_line("PULL car1:speed", node.clock.now());
    BOOST_TEST(link.take() == "[1]\n{\"value\":1}\n{\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(a_waiting_request_sees_its_own_line) {
    node.on(verb::push, "echo", [](const cles::request& r, cles::json_writer& w) {
        w.raw("{\"p\":\"" + std::string{r.parameter(0)} + "\",\"body\":" + std::string{r.body()} + "}");
    });
    link.ask("DELEGATE car1:work");
    {
        std::string line = "PUSH car1:echo/a%41 {\"x\":1}";
        link.ask(line);
        line.assign(line.size(), '#'); // as a read buffer is reused
    }
    finish(0, "[1]");
    BOOST_TEST(link.take() == "[1]\n{\"p\":\"aA\",\"body\":{\"x\":1}}\n");
}

BOOST_AUTO_TEST_CASE(links_do_not_wait_for_each_other) {
    cles::test::test_link other{node};
    link.ask("DELEGATE car1:work");
    BOOST_TEST(other.kind("PULL car1:speed") == "ok");
}

BOOST_AUTO_TEST_CASE(a_request_with_reply_no_takes_its_turn_and_is_not_answered) {
    link.ask("DELEGATE car1:work");
    link.ask("PUSH car1:count reply=no");
    link.ask("PULL car1:speed");
    finish(0, "[1]");
    BOOST_TEST(link.sent() == "ok, ok");
    BOOST_TEST(counted == 1);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(with_id)

BOOST_AUTO_TEST_CASE(requests_with_id_start_at_once_and_are_answered_when_ready) {
    link.ask("DELEGATE car1:work/a id=1");
    link.ask("DELEGATE car1:work/b id=2");
    BOOST_TEST(node.started.size() == 2U);
    finish(1, "[2]");
    BOOST_TEST(link.take() == "id=2 [2]\n");
    finish(0, "[1]");
    BOOST_TEST(link.take() == "id=1 [1]\n");
}

BOOST_AUTO_TEST_CASE(requests_with_id_do_not_wait_for_those_without) {
    link.ask("DELEGATE car1:work");
    BOOST_TEST(link.ask("PULL car1:speed id=1") == "id=1 {\"v\":3}\n");
    link.ask("PULL car1:speed");
    BOOST_TEST(link.ask("PULL car1:speed id=2") == "id=2 {\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(requests_without_id_do_not_wait_for_those_with) {
    link.ask("DELEGATE car1:work id=1");
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
}

BOOST_AUTO_TEST_CASE(an_id_may_be_used_again_once_it_was_answered) {
    BOOST_TEST(link.kind("PULL car1:speed id=1") == "id=1 ok");
    BOOST_TEST(link.kind("PULL car1:speed id=1") == "id=1 ok");
    link.ask("DELEGATE car1:work id=1");
    finish(0, "[]");
    link.take();
    link.ask("DELEGATE car1:work id=1");
    BOOST_TEST(node.started.size() == 2U);
    BOOST_TEST(link.finishes == 0);
}

BOOST_AUTO_TEST_CASE(an_id_belongs_to_one_link) {
    cles::test::test_link other{node};
    link.ask("DELEGATE car1:work id=1");
    BOOST_TEST(other.kind("PULL car1:speed id=1") == "id=1 ok");
    BOOST_TEST(other.finishes == 0);
}

BOOST_AUTO_TEST_CASE(the_largest_id_is_2_to_the_63_minus_1) {
    BOOST_TEST(link.ask("PULL car1:speed id=9223372036854775807") == "id=9223372036854775807 {\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(a_second_request_with_an_id_in_flight_is_bad_request_and_closes_the_link) {
    link.ask("DELEGATE car1:work id=1");
    link.ask("DELEGATE car1:work id=2");
    link.ask("DELEGATE car1:work");
    link.ask("PULL car1:speed");
    BOOST_TEST(link.kind("PULL car1:speed id=1") == "id=1 bad_request");
    BOOST_TEST(link.finishes == 1);
    for (const auto& entry : node.started) {
        BOOST_TEST(entry->stopped);
    }
    finish(0, "[1]");
    BOOST_TEST(link.take().empty()); // nothing more is answered
    BOOST_TEST(link.ask("PULL car1:speed").empty());
    BOOST_TEST(link.ask("FLY").empty());
    BOOST_TEST(node.host->deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(a_handler_may_answer_another_request_while_it_runs) {
    node.on(verb::push, "release", [this](const cles::request& r, cles::json_writer& w) {
        finish(0, "[1]");
        // The request that continued has used the link's memory: the parameters of this one must be unchanged.
        w.value(r.parameter(0));
    });
    node.on(verb::pull, "echo", [](const cles::request& r, cles::json_writer& w) { w.value(r.parameter(0)); });
    link.ask("DELEGATE car1:work");
    link.ask("PULL car1:echo/%C3%A4" + std::string(500, 'x') + "%20");
    const auto answer = link.ask("PUSH car1:release/a%20b id=2");
    BOOST_TEST(answer.starts_with("[1]\n{\"value\":\"\xC3\xA4xxx"), answer);
    BOOST_TEST(answer.ends_with("x \"}\nid=2 {\"value\":\"a b\"}\n"), answer);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(deadlines)

BOOST_AUTO_TEST_CASE(at_the_deadline_a_request_is_answered_and_its_handler_stopped) {
    link.ask("PULL car1:slow id=7 deadline=200");
    node.pass(199ms);
    BOOST_TEST(link.take().empty());
    BOOST_TEST(!started(0).stopped);
    node.pass(1ms);
    BOOST_TEST(link.sent() == "id=7 deadline");
    BOOST_TEST(started(0).stopped);
    finish(0, "[1]");
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(the_default_is_5_s_and_30_s_for_delegate) {
    link.ask("PULL car1:slow id=1");
    link.ask("PUSH car1:store id=2");
    link.ask("DELEGATE car1:work id=3");
    node.pass(4999ms);
    BOOST_TEST(link.take().empty());
    node.pass(1ms);
    BOOST_TEST(link.sent() == "id=1 deadline, id=2 deadline");
    node.pass(24'999ms);
    BOOST_TEST(link.take().empty());
    node.pass(1ms);
    BOOST_TEST(link.sent() == "id=3 deadline");
}

BOOST_AUTO_TEST_CASE(each_deadline_counts_from_its_arrival) {
    link.ask("DELEGATE car1:work/a");
    node.pass(300ms);
    link.ask("DELEGATE car1:work/b deadline=1000");
    node.pass(600ms);
    finish(0, "[1]"); // the second has waited 600 of its 1000 ms
    BOOST_TEST(link.take() == "[1]\n");
    node.pass(399ms);
    BOOST_TEST(link.take().empty());
    node.pass(1ms);
    BOOST_TEST(link.sent() == "deadline");
    BOOST_TEST(started(1).stopped);
}

BOOST_AUTO_TEST_CASE(a_request_that_expired_while_waiting_is_answered_in_order_and_does_not_run) {
    link.ask("DELEGATE car1:work");
    link.ask("PUSH car1:count deadline=100");
    link.ask("PUSH car1:count deadline=1000");
    node.pass(100ms);
    BOOST_TEST(link.take().empty());
    finish(0, "[1]");
    BOOST_TEST(link.sent() == "ok, deadline, ok");
    BOOST_TEST(counted == 1);
}

BOOST_AUTO_TEST_CASE(the_next_request_runs_when_the_previous_one_expires) {
    link.ask("PULL car1:slow deadline=100");
    link.ask("PULL car1:speed");
    node.pass(100ms);
    BOOST_TEST(link.sent() == "deadline, ok");
}

BOOST_AUTO_TEST_CASE(the_handler_sees_its_deadline) {
    cles::time_point seen{};
    node.on(verb::pull, "when", [&](const cles::request& r, cles::json_writer&) { seen = r.deadline(); });
    link.ask("PULL car1:when deadline=250");
    BOOST_CHECK(seen == node.clock.now() + 250ms);
}

BOOST_AUTO_TEST_CASE(a_deadline_is_disarmed_by_the_reply) {
    link.ask("DELEGATE car1:work id=7 deadline=100");
    finish(0, "[]");
    BOOST_TEST(node.host->deadlines.size() == 0U);
    link.take();
    node.pass(1h);
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(a_deadline_with_reply_no_is_counted_and_not_answered) {
    link.ask("PUSH car1:store id=7 reply=no deadline=100");
    node.pass(100ms);
    BOOST_TEST(link.take().empty());
    BOOST_TEST(started(0).stopped);
    BOOST_TEST(node.counts().errors_unsent == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
