// SPDX-License-Identifier: BSL-1.0
#include "port/log_budget.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace log_budget_cases {
namespace {

using cles::core::log_budget;

struct fixture {
    std::optional<std::uint64_t> take(const log_budget::line& l) { return budget.take(l, clock.now()); }
    /// How many of these are logged.
    std::size_t count(std::size_t times, const log_budget::line& l) {
        std::size_t lines = 0;
        for (std::size_t i = 0; i < times; ++i) {
            lines += take(l) ? 1U : 0U;
        }
        return lines;
    }
    std::size_t count_sources(std::size_t from, std::size_t count, std::string_view kind) {
        std::size_t lines = 0;
        for (auto i = from; i < from + count; ++i) {
            const auto source = std::to_string(i);
            lines += take({.kind = kind, .source = source}) ? 1U : 0U;
        }
        return lines;
    }

    cles::test::manual_clock clock;
    log_budget budget;
};

} // namespace
} // namespace log_budget_cases

BOOST_FIXTURE_TEST_SUITE(log_budget, log_budget_cases::fixture)

using namespace std::chrono_literals;
using budget_type = cles::core::log_budget;

BOOST_AUTO_TEST_CASE(each_source_has_its_lines_a_minute) {
    BOOST_TEST(take({.kind = "a", .source = "10.0.0.1"}).value() == 0U);
    BOOST_TEST(count(1000, {.kind = "a", .source = "10.0.0.1"}) == 0U);
    BOOST_TEST(take({.kind = "a", .source = "10.0.0.2"}).value() == 0U); // not silenced by the other
    clock.advance(59s);
    BOOST_TEST(!take({.kind = "a", .source = "10.0.0.1"}));
    clock.advance(1s);
    BOOST_TEST(take({.kind = "a", .source = "10.0.0.1"}).value() == 1001U);
    BOOST_TEST(!take({.kind = "a", .source = "10.0.0.1"}));
}

BOOST_AUTO_TEST_CASE(a_source_may_have_several_lines) {
    const budget_type::line several{.kind = "a", .source = "10.0.0.1", .most = 3};
    BOOST_TEST(count(10, several) == 3U);
    clock.advance(60s);
    BOOST_TEST(take(several).value() == 7U);
    BOOST_TEST(count(10, several) == 2U);
}

BOOST_AUTO_TEST_CASE(the_same_text_is_logged_once) {
    const budget_type::line first{.kind = "a", .source = "10.0.0.1", .text = "first", .most = 8};
    const budget_type::line second{.kind = "a", .source = "10.0.0.1", .text = "second", .most = 8};
    for (int i = 0; i < 10; ++i) { // even if they take turns
        BOOST_TEST(take(first).has_value() == (i == 0));
        BOOST_TEST(take(second).has_value() == (i == 0));
    }
    BOOST_TEST(take({.kind = "a", .source = "10.0.0.2", .text = "first"}).has_value());
    clock.advance(60s);
    BOOST_TEST(take(first).value() == 18U);
}

BOOST_AUTO_TEST_CASE(a_longer_time_may_be_stated) {
    const budget_type::line daily{.kind = "a", .text = "first", .most = 8, .in = 24h};
    BOOST_TEST(take(daily).has_value());
    clock.advance(24h - 1ns);
    BOOST_TEST(!take(daily));
    clock.advance(1ns);
    BOOST_TEST(take(daily).has_value());
}

BOOST_AUTO_TEST_CASE(its_sources_are_limited) {
    BOOST_TEST(count_sources(0, 10'000, "a") == budget_type::max_sources);
    clock.advance(60s);
    BOOST_TEST(count_sources(20'000, 10'000, "a") == budget_type::max_sources); // in the place of those that are over
}

BOOST_AUTO_TEST_CASE(a_kind_does_not_silence_another) {
    BOOST_TEST(count_sources(0, 10'000, "a") == budget_type::max_sources);
    BOOST_TEST(count_sources(0, 1, "a") == 0U);
    BOOST_TEST(take({.kind = "b", .source = "0"}).has_value());
}

BOOST_AUTO_TEST_SUITE_END()
