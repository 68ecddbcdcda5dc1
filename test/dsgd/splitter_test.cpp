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

// Slots whose speeds (points per millisecond) are given by what they are at the beginning of a shard.
outcome run(std::uint64_t points, std::size_t slots, const std::function<double(std::size_t, double)>& speed) {
    dsgd::splitter division{points, slots};
    outcome out{.ended = std::vector<double>(slots, -1), .trained = std::vector<std::uint64_t>(slots), .shards = {}};
    std::vector<double> until(slots);
    const auto begin = [&](std::size_t slot, double now) {
        const auto shard = division.next(slot);
        if (shard.count == 0) {
            out.ended[slot] = now;
            return;
        }
        out.shards.push_back(shard);
        out.trained[slot] += shard.count;
        until[slot] = now + static_cast<double>(shard.count) / speed(slot, now);
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
            BOOST_TEST(done.last() - done.first() <= dsgd::splitter::least_ms);
            const auto ideal = 200'000 / (40 + 40 / times);
            BOOST_TEST(done.last() <= ideal + dsgd::splitter::least_ms);
            BOOST_TEST(done.shards.size() < 60U);
        }
    }
}

BOOST_AUTO_TEST_CASE(no_shard_is_shorter_than_worth_a_round_trip) {
    const auto done = run(200'000, 4, [](std::size_t, double) { return 20.0; });
    for (const auto& shard : done.shards) {
        BOOST_TEST(double(shard.count) / 20 >= dsgd::splitter::least_ms / 8);
    }
}

BOOST_AUTO_TEST_CASE(a_node_that_becomes_slower_gets_less) {
    const auto done =
        run(200'000, 2, [](std::size_t slot, double now) { return slot == 1 && now > 600 ? 25.0 : 50.0; });
    BOOST_TEST(done.trained[1] < done.trained[0]);
    BOOST_TEST(done.last() - done.first() <= dsgd::splitter::least_ms);
}

BOOST_AUTO_TEST_CASE(little_work_is_divided_too) {
    const auto done = run(2'000, 4, [](std::size_t, double) { return 20.0; }); // 25 ms
    BOOST_TEST(*std::max_element(done.trained.begin(), done.trained.end()) <= 700U);
}

BOOST_AUTO_TEST_CASE(the_first_shard_is_small_and_the_second_takes_half_of_what_is_left) {
    dsgd::splitter division{16'000, 2};
    BOOST_TEST((division.next(0) == sgd::shard{0, 1'000}));
    BOOST_TEST((division.next(1) == sgd::shard{1'000, 1'000}));
    division.done(0, 100);
    BOOST_TEST((division.next(0) == sgd::shard{2'000, 3'500})); // the other one counts as just as fast
    division.done(1, 300);
    BOOST_TEST(division.next(1).count == 1'312U); // 3.33 of 13.33 points in a millisecond, and half of 10500
}

BOOST_AUTO_TEST_SUITE_END()
