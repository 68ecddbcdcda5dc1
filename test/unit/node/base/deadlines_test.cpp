// SPDX-License-Identifier: BSL-1.0
#include "node/base/deadlines.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <random>
#include <vector>

namespace deadlines {
namespace {

using cles::time_point;
using namespace std::chrono_literals;

constexpr time_point start{1h};

class bell final : public cles::core::deadline {
  public:
    std::function<void(time_point)> rings;

  private:
    void on_deadline(time_point now) override {
        if (rings) {
            rings(now);
        }
    }
};

} // namespace
} // namespace deadlines

BOOST_AUTO_TEST_SUITE(deadlines)

BOOST_AUTO_TEST_CASE(nothing_is_next_if_nothing_is_armed) {
    cles::core::deadline_queue queue;
    BOOST_TEST(!queue.next().has_value());
    queue.expire(start + 24h);
    BOOST_TEST(queue.size() == 0U);
}

BOOST_AUTO_TEST_CASE(the_observer_is_called_for_a_deadline_that_becomes_the_first) {
    cles::core::deadline_queue queue;
    std::vector<time_point> seen;
    queue.set_observer([&](time_point earliest) { seen.push_back(earliest); });
    bell a;
    bell b;
    queue.arm(a, start + 10ms);
    queue.arm(b, start + 20ms);
    BOOST_CHECK((seen == std::vector{start + 10ms}));
    queue.arm(b, start + 5ms);
    BOOST_CHECK((seen == std::vector{start + 10ms, start + 5ms}));
    queue.disarm(b);
    queue.expire(start + 1h);
    BOOST_TEST(seen.size() == 2U);
}

BOOST_AUTO_TEST_CASE(a_deadline_runs_once_when_it_is_due) {
    cles::core::deadline_queue queue;
    bell a;
    int rung = 0;
    a.rings = [&](time_point now) {
        ++rung;
        BOOST_CHECK(now == start + 10ms);
    };
    queue.arm(a, start + 10ms);
    BOOST_TEST(a.armed());
    BOOST_CHECK(queue.next() == start + 10ms);
    queue.expire(start + 10ms - 1ns);
    BOOST_TEST(rung == 0);
    queue.expire(start + 10ms);
    BOOST_TEST(rung == 1);
    BOOST_TEST(!a.armed());
    queue.expire(start + 1h);
    BOOST_TEST(rung == 1);
}

BOOST_AUTO_TEST_CASE(deadlines_run_in_the_order_of_their_times) {
    cles::core::deadline_queue queue;
    std::vector<int> order;
    std::vector<bell> bells(5);
    const int after[] = {30, 10, 50, 20, 40};
    for (std::size_t i = 0; i < bells.size(); ++i) {
        bells[i].rings = [&order, ms = after[i]](time_point) { order.push_back(ms); };
        queue.arm(bells[i], start + std::chrono::milliseconds{after[i]});
    }
    queue.expire(start + 45ms);
    const std::vector<int> expected{10, 20, 30, 40};
    BOOST_TEST(order == expected, boost::test_tools::per_element());
    BOOST_CHECK(queue.next() == start + 50ms);
}

BOOST_AUTO_TEST_CASE(arming_again_moves_it) {
    cles::core::deadline_queue queue;
    bell a;
    int rung = 0;
    a.rings = [&](time_point) { ++rung; };
    queue.arm(a, start + 10ms);
    queue.arm(a, start + 30ms);
    BOOST_TEST(queue.size() == 1U);
    queue.expire(start + 20ms);
    BOOST_TEST(rung == 0);
    queue.arm(a, start + 21ms);
    queue.expire(start + 25ms);
    BOOST_TEST(rung == 1);
}

BOOST_AUTO_TEST_CASE(a_disarmed_or_destroyed_deadline_does_not_run) {
    cles::core::deadline_queue queue;
    bell kept;
    int rung = 0;
    kept.rings = [&](time_point) { ++rung; };
    {
        bell gone;
        gone.rings = [&](time_point) { ++rung; };
        queue.arm(gone, start);
        queue.arm(kept, start);
        queue.disarm(kept);
        queue.disarm(kept); // a second time has no effect
    }
    BOOST_TEST(queue.size() == 0U);
    queue.expire(start + 1h);
    BOOST_TEST(rung == 0);
}

BOOST_AUTO_TEST_CASE(a_deadline_may_disarm_another_that_is_due_too) {
    cles::core::deadline_queue queue;
    bell first;
    bell second;
    bool rung = false;
    first.rings = [&](time_point) { queue.disarm(second); };
    second.rings = [&](time_point) { rung = true; };
    queue.arm(first, start);
    queue.arm(second, start + 1ms);
    queue.expire(start + 1ms);
    BOOST_TEST(!rung);
}

BOOST_AUTO_TEST_CASE(a_deadline_armed_meanwhile_for_now_runs_too) {
    cles::core::deadline_queue queue;
    bell a;
    int rung = 0;
    a.rings = [&](time_point now) {
        if (++rung < 3) {
            queue.arm(a, now);
        }
    };
    queue.arm(a, start);
    queue.expire(start);
    BOOST_TEST(rung == 3);
}

BOOST_AUTO_TEST_CASE(destroying_the_queue_disarms_its_deadlines) {
    bell a;
    {
        cles::core::deadline_queue queue;
        queue.arm(a, start);
    }
    BOOST_TEST(!a.armed());
}

BOOST_AUTO_TEST_CASE(it_behaves_like_a_sorted_list) {
    cles::core::deadline_queue queue;
    std::vector<bell> bells(200);
    std::mt19937 random{3};
    auto now = start;
    std::size_t rung = 0;
    for (auto& a : bells) {
        a.rings = [&](time_point at) {
            ++rung;
            BOOST_REQUIRE(a.due() <= at);
            BOOST_REQUIRE(!a.armed());
            for (const auto& other : bells) { // none that is still armed was due earlier
                BOOST_REQUIRE((!other.armed() || other.due() >= a.due()));
            }
        };
    }
    for (int i = 0; i < 3000; ++i) {
        auto& a = bells[random() % bells.size()];
        switch (random() % 4) {
        case 0:
        case 1: queue.arm(a, now + std::chrono::milliseconds{random() % 100}); break;
        case 2: queue.disarm(a); break;
        default: now += std::chrono::milliseconds{random() % 10}; queue.expire(now);
        }
        const auto armed = std::count_if(bells.begin(), bells.end(), [](const auto& other) { return other.armed(); });
        BOOST_REQUIRE_EQUAL(queue.size(), static_cast<std::size_t>(armed));
        if (queue.next()) {
            const auto soonest = std::min_element(bells.begin(), bells.end(), [](const auto& x, const auto& y) {
                return x.armed() != y.armed() ? x.armed() : x.armed() && x.due() < y.due();
            });
            BOOST_REQUIRE(*queue.next() == soonest->due());
        }
    }
    BOOST_TEST(rung > 100U);
}

BOOST_AUTO_TEST_SUITE_END()
