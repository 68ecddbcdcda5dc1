// SPDX-License-Identifier: BSL-1.0
#include "node/base/memory_budget.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

namespace memory_budget {
namespace {

using cles::core::memory_account;
using cles::core::memory_reservation;

struct fixture {
    std::shared_ptr<memory_account> account() { return std::make_shared<memory_account>(budget); }

    cles::core::memory_budget budget{1000};
};

} // namespace
} // namespace memory_budget

BOOST_FIXTURE_TEST_SUITE(memory_budget, fixture)

BOOST_AUTO_TEST_CASE(a_reservation_counts_for_as_long_as_it_lives) {
    const auto a = account();
    {
        memory_reservation r{a};
        BOOST_TEST(r.try_resize(100));
        BOOST_TEST(r.try_resize(40));
        r.resize(70);
        BOOST_TEST(budget.used() == 70U);
        BOOST_TEST(a->used() == 70U);
        BOOST_TEST(budget.free() == 930U);
        memory_reservation other{std::move(r)};
        BOOST_TEST(budget.used() == 70U);
        r = std::move(other);
        BOOST_TEST(budget.used() == 70U);
    }
    BOOST_TEST(budget.used() == 0U);
    BOOST_TEST(a->used() == 0U);
}

BOOST_AUTO_TEST_CASE(a_refused_reservation_does_not_change) {
    memory_reservation r{account()};
    BOOST_TEST(r.try_resize(300));
    BOOST_TEST(!r.try_resize(900));
    BOOST_TEST(!r.try_resize(std::numeric_limits<std::size_t>::max()));
    BOOST_TEST(r.size() == 300U);
    BOOST_TEST(budget.used() == 300U);
    BOOST_TEST(budget.refusals() == 2U);
    BOOST_TEST(r.try_resize(300)); // not more than before
    r.resize(5000);                // memory in use counts, even over the limit
    BOOST_TEST(budget.free() == 0U);
    BOOST_TEST(r.try_resize(4000)); // shrinking always succeeds
}

BOOST_AUTO_TEST_CASE(without_an_account_nothing_is_counted) {
    memory_reservation r;
    BOOST_TEST(r.try_resize(5000));
    r.resize(6000);
    BOOST_TEST(budget.used() == 0U);
}

BOOST_AUTO_TEST_CASE(a_single_account_gets_half) {
    memory_reservation r{account()};
    while (r.try_resize(r.size() + 1)) {
    }
    BOOST_TEST(r.size() == 500U);
}

BOOST_AUTO_TEST_CASE(accounts_that_want_much_share_equally_and_leave_some_for_the_next) {
    for (const std::size_t count : {2U, 3U, 9U}) {
        std::vector<memory_reservation> all;
        for (std::size_t i = 0; i < count; ++i) {
            all.emplace_back(account());
        }
        for (bool more = true; more;) {
            more = false;
            for (auto& r : all) {
                more = r.try_resize(r.size() + 1) || more;
            }
        }
        for (const auto& r : all) {
            BOOST_TEST(r.size() >= 1000 / (count + 1) - 1);
            BOOST_TEST(r.size() <= 1000 / (count + 1) + 1);
        }
        BOOST_TEST(budget.free() >= 1000 / (count + 1) - 1);
    }
}

BOOST_AUTO_TEST_CASE(a_late_account_is_not_shut_out_by_a_greedy_one) {
    memory_reservation greedy{account()};
    BOOST_TEST(greedy.try_resize(500));
    memory_reservation late{account()};
    BOOST_TEST(late.try_resize(200));
    BOOST_TEST(!greedy.try_resize(501));
    greedy.resize(100);
    BOOST_TEST(greedy.try_resize(200));
}

BOOST_AUTO_TEST_CASE(the_half_share_is_independent_of_what_links_hold) {
    memory_reservation link{account()};
    BOOST_TEST(link.try_resize(400));
    memory_reservation values{std::make_shared<memory_account>(budget, memory_account::share::half)};
    BOOST_TEST(values.try_resize(500));
    BOOST_TEST(!values.try_resize(501));
    values.resize(450);
    BOOST_TEST(!link.try_resize(401));
    BOOST_TEST(values.try_resize(500));
    link.resize(495);
    values.resize(480);
    BOOST_TEST(values.try_resize(500)); // as far as memory is free
    link.resize(600);
    values.resize(300);
    BOOST_TEST(values.try_resize(400));
    BOOST_TEST(!values.try_resize(401));
    BOOST_TEST(!values.try_resize(2000));
}

BOOST_AUTO_TEST_CASE(the_parts_add_up_to_what_is_used) {
    std::minstd_rand draw{7};
    std::vector<std::shared_ptr<memory_account>> accounts;
    std::vector<memory_reservation> held;
    for (int i = 0; i < 5; ++i) {
        accounts.push_back(account());
    }
    for (int step = 0; step < 20'000; ++step) {
        switch (draw() % 4) {
        case 0: held.emplace_back(accounts[draw() % accounts.size()]); break;
        case 1:
            if (!held.empty()) {
                held.erase(held.begin() + static_cast<std::ptrdiff_t>(draw() % held.size()));
            }
            break;
        case 2:
            if (!held.empty()) {
                held[draw() % held.size()].resize(draw() % 50);
            }
            break;
        default:
            if (!held.empty()) {
                static_cast<void>(held[draw() % held.size()].try_resize(draw() % 200));
            }
        }
        std::size_t by_account = 0;
        for (const auto& a : accounts) {
            by_account += a->used();
        }
        std::size_t by_reservation = 0;
        for (const auto& r : held) {
            by_reservation += r.size();
        }
        BOOST_REQUIRE(by_account == budget.used());
        BOOST_REQUIRE(by_reservation == budget.used());
    }
    held.clear();
    BOOST_TEST(budget.used() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
