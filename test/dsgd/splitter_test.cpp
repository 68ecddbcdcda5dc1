// SPDX-License-Identifier: BSL-1.0
#include "dsgd/splitter.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <functional>

namespace splitter {
namespace {

struct outcome {
    std::vector<double> ended;          ///< when each slot had nothing left, in ms
    std::vector<std::uint64_t> trained; ///< points of each slot
    std::vector<sgd::shard> shards;

    double last() const { return *std::max_element(ended.begin(), ended.end()); }
    double first() const { return *std::min_element(ended.begin(), ended.end()); }
};

using speeds = std::function<double(std::size_t, double)>;

// When that many points are trained on, at a speed that changes meanwhile.
double end_of(double now, double points, const std::function<double(double)>& speed) {
    constexpr double step_ms = 0.5;
    for (; points > speed(now) * step_ms; now += step_ms) {
        points -= speed(now) * step_ms;
    }
    return now + points / speed(now);
}

// Slots with these speeds (points per millisecond), which may change during a shard.
outcome run(std::uint64_t points, std::size_t slots, const speeds& speed) {
    dsgd::splitter division{points, slots};
    outcome out{.ended = std::vector<double>(slots, -1), .trained = std::vector<std::uint64_t>(slots), .shards = {}};
    std::vector<double> until(slots);
    const auto begin = [&](std::size_t slot, double now) {
        const auto shard = division.next(slot, now);
        if (shard.count == 0) {
            out.ended[slot] = now;
            return;
        }
        out.shards.push_back(shard);
        out.trained[slot] += shard.count;
        until[slot] = end_of(now, static_cast<double>(shard.count), [&](double at) { return speed(slot, at); });
    };
    for (std::size_t slot = 0; slot < slots; ++slot) {
        begin(slot, 0);
    }
    for (;;) {
        std::size_t next = slots;
        for (std::size_t slot = 0; slot < slots; ++slot) {
            if (out.ended[slot] < 0 && (next == slots || until[slot] < until[next])) {
                next = slot;
            }
        }
        if (next == slots) {
            return out;
        }
        division.done(next, until[next]);
        begin(next, until[next]);
    }
}

} // namespace
} // namespace splitter

BOOST_AUTO_TEST_SUITE(splitter)

BOOST_AUTO_TEST_CASE(all_points_are_trained_on_once) {
    for (const std::uint64_t points : {1U, 2U, 7U, 1'000U, 200'000U}) {
        for (const std::size_t slots : {1U, 3U, 16U}) {
            auto shards = run(points, slots, [](std::size_t slot, double) { return 1.0 + double(slot); }).shards;
            std::uint64_t next = 0;
            for (const auto& shard : shards) {
                BOOST_TEST(shard.first == next);
                next += shard.count;
            }
            BOOST_TEST(next == points);
        }
    }
}

BOOST_AUTO_TEST_CASE(all_end_at_almost_the_same_time) {
    for (const double times : {1.0, 1.3, 2.0, 10.0}) {
        BOOST_TEST_CONTEXT("two of four slots are slower, " << times << " times") {
            const auto done = run(200'000, 4, [&](std::size_t slot, double) { return slot < 2 ? 20.0 : 20.0 / times; });
            BOOST_TEST(done.last() - done.first() <= dsgd::splitter::least_shard_ms);
            const auto ideal = 200'000 / (40 + 40 / times);
            BOOST_TEST(done.last() <= ideal + dsgd::splitter::least_shard_ms);
            BOOST_TEST(done.shards.size() < 90U); // of 2.5 s and more for each slot
        }
    }
}

BOOST_AUTO_TEST_CASE(no_shard_is_shorter_than_worth_a_round_trip) {
    const auto done = run(200'000, 4, [](std::size_t, double) { return 20.0; });
    for (const auto& shard : done.shards) {
        BOOST_TEST(double(shard.count + 1) / 20 >= dsgd::splitter::least_shard_ms / 4); // rounded down
    }
}

BOOST_AUTO_TEST_CASE(no_shard_has_too_few_points) {
    for (const std::size_t slots : {1U, 4U, 1'024U}) {
        dsgd::splitter division{10'000, slots, 700};
        std::uint64_t next = 0;
        for (std::size_t i = 0; next < 10'000; ++i) {
            const auto shard = division.next(i % slots, double(i));
            division.done(i % slots, double(i) + 0.5);
            BOOST_TEST(shard.count >= 700U);
            next += shard.count;
        }
    }
    BOOST_TEST((dsgd::splitter{300, 4, 700}.next(2, 0) == sgd::shard{0, 300})); // there are no more
}

BOOST_AUTO_TEST_CASE(a_node_that_becomes_slower_gets_less) {
    const auto done =
        run(200'000, 2, [](std::size_t slot, double now) { return slot == 1 && now > 600 ? 25.0 : 50.0; });
    BOOST_TEST(done.trained[1] < done.trained[0]);
    BOOST_TEST(done.last() - done.first() <= dsgd::splitter::least_shard_ms);
}

BOOST_AUTO_TEST_CASE(a_node_that_becomes_much_slower_during_a_shard_is_not_waited_for_long) {
    for (const double from : {300.0, 600.0, 1'000.0, 1'500.0}) {
        BOOST_TEST_CONTEXT("ten times slower, from " << from << " ms on") {
            const auto done =
                run(200'000, 2, [&](std::size_t slot, double now) { return slot == 1 && now > from ? 5.0 : 50.0; });
            const auto ideal = from + (200'000 - from * 100) / 55;
            BOOST_TEST(done.last() <= ideal * 1.2);
        }
    }
}

BOOST_AUTO_TEST_CASE(a_lost_shard_is_divided_among_all) {
    dsgd::splitter division{16'000, 2};
    division.next(0, 0);
    division.next(1, 0);
    division.done(0, 100);
    division.done(1, 100);
    const auto lost = division.next(1, 100);
    double now = 100;
    for (auto shard = division.next(0, now); shard.count > 0; shard = division.next(0, now)) {
        now += static_cast<double>(shard.count) / 10;
        division.done(0, now);
    }
    division.lost(1);
    std::uint64_t first = 0;
    std::uint64_t again = 0;
    while (again < lost.count) {
        now += 1'000;
        for (const std::size_t slot : {1U, 0U}) {
            const auto shard = division.next(slot, now);
            BOOST_TEST(shard.first == (shard.count == 0 ? 0 : lost.first + again));
            again += shard.count;
            first += slot == 0 ? shard.count : 0;
            division.done(slot, now + static_cast<double>(shard.count) / 10);
        }
    }
    BOOST_TEST(again == lost.count);
    BOOST_TEST(first > lost.count / 4);
    BOOST_TEST(first < lost.count);
    BOOST_TEST(division.next(0, 9'000).count == 0U);
}

BOOST_AUTO_TEST_CASE(time_without_a_shard_does_not_count) {
    dsgd::splitter division{16'000, 2};
    division.next(0, 0);
    division.next(1, 0);
    division.done(0, 100);
    division.lost(1);
    division.next(1, 5'000); // its 1000 points
    division.done(1, 5'100);
    division.next(0, 5'100);
    BOOST_TEST(division.next(1, 5'100).count == 1'531U); // as if the two were equally fast
}

BOOST_AUTO_TEST_CASE(little_work_is_divided_too) {
    const auto done = run(2'000, 4, [](std::size_t, double) { return 20.0; }); // 25 ms
    BOOST_TEST(*std::max_element(done.trained.begin(), done.trained.end()) <= 700U);
}

BOOST_AUTO_TEST_CASE(the_first_shard_is_small_and_the_second_takes_a_quarter_of_what_is_left) {
    dsgd::splitter division{16'000, 2};
    BOOST_TEST((division.next(0, 0) == sgd::shard{0, 1'000}));
    BOOST_TEST((division.next(1, 0) == sgd::shard{1'000, 1'000}));
    division.done(0, 100);
    BOOST_TEST((division.next(0, 100) == sgd::shard{2'000, 1'750})); // the other one counts as just as fast
    division.done(1, 300);
    BOOST_TEST(division.next(1, 300).count == 765U); // 3.33 of 13.33 points in a millisecond, and a quarter of 12250
}

BOOST_AUTO_TEST_SUITE_END()
