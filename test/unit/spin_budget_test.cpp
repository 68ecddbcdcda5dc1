// SPDX-License-Identifier: BSL-1.0
#include "core/spin_budget.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>

namespace spin_budget {
namespace {

using namespace std::chrono_literals;

// How many of the next waits begin with looking, which never finds anything.
int tries_in(cles::core::spin_budget& budget, int waits) {
    int tries = 0;
    for (int i = 0; i < waits; ++i) {
        if (budget.next() != 0ns) {
            budget.missed();
            ++tries;
        }
    }
    return tries;
}

} // namespace
} // namespace spin_budget

BOOST_AUTO_TEST_SUITE(spin_budget)

BOOST_AUTO_TEST_CASE(looks_as_long_as_allowed_while_that_finds_something) {
    cles::core::spin_budget budget{50us};
    for (int i = 0; i < 1000; ++i) {
        BOOST_REQUIRE((budget.next() == 50us));
        budget.found();
    }
}

BOOST_AUTO_TEST_CASE(puts_up_with_some_misses) {
    cles::core::spin_budget budget{50us};
    for (int i = 0; i < 1000; ++i) {
        BOOST_REQUIRE((budget.next() == 50us));
        i % 4 == 0 ? budget.found() : budget.missed();
    }
}

BOOST_AUTO_TEST_CASE(gives_up_where_it_finds_nothing_but_tries_again_now_and_then) {
    cles::core::spin_budget budget{50us};
    BOOST_TEST(tries_in(budget, 20'000) < 20);
    BOOST_TEST(tries_in(budget, 100'000) > 10);
    BOOST_TEST(tries_in(budget, 100'000) < 40);
}

BOOST_AUTO_TEST_CASE(one_success_brings_it_back) {
    cles::core::spin_budget budget{50us};
    tries_in(budget, 20'000);
    int waits = 0;
    while (budget.next() == 0ns) {
        ++waits;
    }
    BOOST_TEST(waits < 5000);
    budget.found();
    BOOST_TEST((budget.next() == 50us));
}

BOOST_AUTO_TEST_SUITE_END()
