// SPDX-License-Identifier: BSL-1.0
#include "node/routing/query_scheduler.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace query_scheduler {
namespace {

using namespace std::chrono_literals;
using queue = cles::core::query_scheduler;
using cles::core::query_target;

struct fixture {
    query_target& node(const std::string& where) {
        nodes.push_back(std::make_unique<query_target>());
        nodes.back()->where = where;
        asks.enter(*nodes.back());
        return *nodes.back();
    }
    query_target* next() { return asks.next(clock.now()); }
    void fails(query_target& who, bool unreachable = true) { asks.failed(who, unreachable, clock.now()); }
    /// Fails all queries that may be made within `span`, and returns their number.
    std::size_t fail_for(std::chrono::milliseconds span, bool unreachable = true) {
        std::size_t count = 0;
        for (const auto end = clock.now() + span; clock.now() < end; clock.advance(10ms)) {
            while (auto* who = next()) {
                fails(*who, unreachable);
                ++count;
            }
        }
        return count;
    }

    cles::test::manual_clock clock;
    std::vector<std::unique_ptr<query_target>> nodes;
    std::vector<query_target*> postponed;
    queue asks{[this](query_target& who) { postponed.push_back(&who); }};
};

} // namespace
} // namespace query_scheduler

BOOST_FIXTURE_TEST_SUITE(query_scheduler, fixture)

BOOST_AUTO_TEST_CASE(entered_node_is_asked_at_once_and_only_once) {
    auto& one = node("tcp://10.0.0.1:1");
    asks.enter(one);
    BOOST_TEST(next() == &one);
    BOOST_TEST(next() == nullptr);
    asks.answered(one);
    BOOST_TEST(next() == nullptr);
    BOOST_TEST(!asks.due());
}

BOOST_AUTO_TEST_CASE(at_most_sixteen_are_asked_at_once) {
    for (int i = 0; i < 20; ++i) {
        node("tcp://10.0.0.1:" + std::to_string(i + 1));
    }
    std::vector<query_target*> asked;
    while (auto* who = next()) {
        asked.push_back(who);
    }
    BOOST_TEST(asked.size() == queue::at_once);
    BOOST_TEST(!asks.due());
    asks.answered(*asked.front());
    BOOST_TEST(next() != nullptr);
    BOOST_TEST(next() == nullptr);
}

BOOST_AUTO_TEST_CASE(pauses_double_from_two_seconds_to_a_minute) {
    auto& one = node("tcp://10.0.0.1:1");
    BOOST_TEST(next() == &one);
    for (const auto pause : {2s, 4s, 8s, 16s, 32s, 60s, 60s}) {
        fails(one);
        clock.advance(pause - 1ms);
        BOOST_TEST(next() == nullptr);
        BOOST_TEST((asks.due() == clock.now() + 1ms));
        clock.advance(1ms);
        BOOST_TEST(next() == &one);
    }
    asks.answered(one);
    asks.enter(one);
    BOOST_TEST(next() == &one);
    fails(one);
    clock.advance(2s);
    BOOST_TEST(next() == &one); // the count has started over
}

BOOST_AUTO_TEST_CASE(names_at_one_dead_url_share_its_pause) {
    for (int i = 0; i < 1024; ++i) {
        node("tcp://127.0.0.1:9");
    }
    BOOST_TEST(fail_for(1s) == 1U);
    BOOST_TEST(postponed.size() == 1023U);
    BOOST_TEST(fail_for(60s) <= 6U);
    auto& live = node("tcp://127.0.0.1:10");
    BOOST_TEST(next() == &live);
}

BOOST_AUTO_TEST_CASE(a_new_node_at_a_failing_url_is_asked_after_its_pause) {
    node("tcp://127.0.0.1:9");
    fails(*next());
    clock.advance(2s - 1ms);
    auto& early = node("tcp://127.0.0.1:9");
    BOOST_TEST(next() == nullptr);
    BOOST_TEST((postponed == std::vector{&early}));
    clock.advance(1ms);
    auto& late = node("tcp://127.0.0.1:9");
    const auto* first = next();
    BOOST_TEST(next() == nullptr); // only one tries
    BOOST_TEST(first != nullptr);
    BOOST_TEST(postponed.size() == (first == &late ? 1U : 2U));
}

BOOST_AUTO_TEST_CASE(when_a_dead_url_answers_again_all_its_nodes_are_asked) {
    for (int i = 0; i < 10; ++i) {
        node("tcp://127.0.0.1:9");
    }
    fails(*next());
    clock.advance(2s);
    auto* first = next();
    BOOST_REQUIRE(first != nullptr);
    BOOST_TEST(next() == nullptr); // only one tries
    asks.answered(*first);
    std::size_t count = 0;
    while (next() != nullptr) {
        ++count;
    }
    BOOST_TEST(count == 9U);
}

BOOST_AUTO_TEST_CASE(rate_of_failures_is_bounded_for_any_number_of_urls) {
    for (int i = 0; i < 1024; ++i) {
        node("tcp://127.0.0.1:" + std::to_string(i + 1));
    }
    BOOST_TEST(fail_for(1ms) == 33U);
    clock.advance(1600ms);
    const auto in_a_minute = fail_for(60s);
    BOOST_TEST(in_a_minute <= 1240U); // 20 a second, plus the burst
    BOOST_TEST(in_a_minute >= 1100U);
}

BOOST_AUTO_TEST_CASE(a_new_node_does_not_wait_for_a_thousand_dead_ones) {
    for (int i = 0; i < 1024; ++i) {
        node("tcp://127.0.0.1:" + std::to_string(i + 1));
    }
    fail_for(1ms);
    auto& live = node("tcp://10.0.0.1:1");
    std::size_t before = 0;
    const auto begun = clock.now();
    for (query_target* who = nullptr; (who = next()) != &live; clock.advance(10ms)) {
        if (who != nullptr) {
            fails(*who);
            ++before;
        }
    }
    BOOST_TEST(before <= 1U);
    BOOST_TEST((clock.now() - begun <= 200ms));
}

BOOST_AUTO_TEST_CASE(wrong_reply_does_not_close_the_url_for_others) {
    auto& wrong = node("tcp://127.0.0.1:9");
    auto& right = node("tcp://127.0.0.1:9");
    for (auto* who = next(); who != nullptr; who = next()) {
        if (who == &wrong) {
            fails(wrong, false);
        } else {
            BOOST_TEST(who == &right);
            asks.answered(right);
        }
    }
    asks.enter(right);
    BOOST_TEST(next() == &right);
}

BOOST_AUTO_TEST_CASE(removed_node_is_not_asked_in_any_state) {
    auto& fresh = node("tcp://10.0.0.1:1");
    asks.remove(fresh);
    BOOST_TEST(next() == nullptr);
    auto& asked = node("tcp://10.0.0.1:1");
    BOOST_TEST(next() == &asked);
    asks.remove(asked);
    auto& waiting = node("tcp://10.0.0.1:1");
    BOOST_TEST(next() == &waiting);
    fails(waiting);
    asks.remove(waiting);
    clock.advance(60s);
    BOOST_TEST(next() == nullptr);
    BOOST_TEST(!asks.due());
}

BOOST_AUTO_TEST_CASE(cost_of_a_failure_does_not_depend_on_the_queue) {
    const auto steps_per_failure = [](std::size_t count, bool one_url) {
        fixture f;
        for (std::size_t i = 0; i < count; ++i) {
            f.node("tcp://127.0.0.1:" + std::to_string(one_url ? 9 : i + 1));
        }
        f.fail_for(1ms); // each new one is visited once
        f.clock.advance(2s);
        f.fail_for(10s);
        const auto before = f.asks.steps();
        const auto failures = f.fail_for(120s);
        return static_cast<double>(f.asks.steps() - before) / static_cast<double>(failures);
    };
    for (const bool one_url : {true, false}) {
        BOOST_TEST(steps_per_failure(4096, one_url) < steps_per_failure(64, one_url) + 4);
        BOOST_TEST(steps_per_failure(4096, one_url) < 10);
    }
}

BOOST_AUTO_TEST_SUITE_END()
