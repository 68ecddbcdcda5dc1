// SPDX-License-Identifier: BSL-1.0
#include "api/spin_budget.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>

namespace spin_budget {
namespace {

using namespace std::chrono_literals;

// How many of the next waits start by polling, which never finds work.
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

BOOST_AUTO_TEST_CASE(polls_as_long_as_allowed_while_it_finds_work) {
    cles::core::spin_budget budget{50us};
    for (int i = 0; i < 1000; ++i) {
        BOOST_REQUIRE((budget.next() == 50us));
        budget.found();
    }
}

BOOST_AUTO_TEST_CASE(tolerates_some_misses) {
    cles::core::spin_budget budget{50us};
    for (int i = 0; i < 1000; ++i) {
        BOOST_REQUIRE((budget.next() == 50us));
        i % 4 == 0 ? budget.found() : budget.missed();
    }
}

BOOST_AUTO_TEST_CASE(gives_up_without_success_but_retries_occasionally) {
    cles::core::spin_budget budget{50us};
    BOOST_TEST(tries_in(budget, 20'000) < 20);
    BOOST_TEST(tries_in(budget, 100'000) > 10);
    BOOST_TEST(tries_in(budget, 100'000) < 40);
}

BOOST_AUTO_TEST_CASE(one_success_restores_polling) {
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
