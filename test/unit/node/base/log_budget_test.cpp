// SPDX-License-Identifier: BSL-1.0
#include "node/base/log_budget.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <optional>
#include <string>

BOOST_AUTO_TEST_SUITE(log_budget)

using cles::core::log_budget;
using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(each_source_has_one_line_a_minute) {
    cles::test::manual_clock clock;
    log_budget budget;
    BOOST_TEST(budget.take("10.0.0.1", clock.now()).value() == 0U);
    for (int i = 0; i < 1000; ++i) {
        BOOST_TEST(!budget.take("10.0.0.1", clock.now()));
    }
    BOOST_TEST(budget.take("10.0.0.2", clock.now()).value() == 0U); // not silenced by the other
    clock.advance(59s);
    BOOST_TEST(!budget.take("10.0.0.1", clock.now()));
    clock.advance(1s);
    BOOST_TEST(budget.take("10.0.0.1", clock.now()).value() == 1001U);
    BOOST_TEST(!budget.take("10.0.0.1", clock.now()));
}

BOOST_AUTO_TEST_CASE(a_source_may_have_several_lines_a_minute) {
    cles::test::manual_clock clock;
    log_budget budget{3};
    const auto taken = [&] {
        int lines = 0;
        for (int i = 0; i < 10; ++i) {
            lines += budget.take("10.0.0.1", clock.now()) ? 1 : 0;
        }
        return lines;
    };
    BOOST_TEST(taken() == 3);
    clock.advance(60s);
    BOOST_TEST(budget.take("10.0.0.1", clock.now()).value() == 7U);
    BOOST_TEST(taken() == 2);
}

BOOST_AUTO_TEST_CASE(its_sources_are_limited) {
    cles::test::manual_clock clock;
    log_budget budget;
    const auto taken = [&](std::size_t from, std::size_t count) {
        std::size_t lines = 0;
        for (auto i = from; i < from + count; ++i) {
            lines += budget.take(std::to_string(i), clock.now()) ? 1U : 0U;
        }
        return lines;
    };
    BOOST_TEST(taken(0, 10'000) == log_budget::max_sources);
    clock.advance(60s);
    BOOST_TEST(taken(20'000, 10'000) == log_budget::max_sources); // in the place of those that are over
}

BOOST_AUTO_TEST_SUITE_END()
