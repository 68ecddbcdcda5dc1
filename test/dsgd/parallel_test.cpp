// SPDX-License-Identifier: BSL-1.0
#include "sgd/parallel.hpp"

#include <boost/test/unit_test.hpp>

namespace parallel {
namespace {

sgd::trained part_of(const char* node, std::uint64_t points, double after_ms, const sgd::classifier& c = {}) {
    return {.node = node, .result = c, .points = points, .steps = points, .ms = after_ms, .after_ms = after_ms};
}

} // namespace
} // namespace parallel

BOOST_AUTO_TEST_SUITE(parallel)

BOOST_AUTO_TEST_CASE(all_points_are_in_one_shard_each) {
    using list = std::vector<double>;
    for (const auto& weights : {list{1}, list{1, 1, 1}, list{3, 1}, list{1e-9, 1, 1e-9}, list{1, 2, 3, 4, 5, 6, 7}}) {
        for (const std::uint64_t points : {7U, 8U, 200'000U}) {
            const auto shards = sgd::divide(points, weights);
            BOOST_TEST(shards.size() == weights.size());
            std::uint64_t next = 0;
            for (const auto& s : shards) {
                BOOST_TEST(s.first == next);
                BOOST_TEST(s.count > 0U);
                next += s.count;
            }
            BOOST_TEST(next == points);
        }
    }
}

BOOST_AUTO_TEST_CASE(a_shard_is_as_large_as_its_weight) {
    BOOST_TEST((sgd::divide(10, {1, 1}) == std::vector<sgd::shard>{{0, 5}, {5, 5}}));
    BOOST_TEST((sgd::divide(200'000, {3, 1}) == std::vector<sgd::shard>{{0, 150'000}, {150'000, 50'000}}));
    BOOST_TEST((sgd::divide(10, {1, 1, 1}) == std::vector<sgd::shard>{{0, 3}, {3, 4}, {7, 3}}));
}

BOOST_AUTO_TEST_CASE(each_order_draws_for_itself) {
    const auto orders = sgd::orders_for({{0, 5}, {5, 7}}, {.epochs = 3, .rate = 0.5, .seed = 10});
    BOOST_TEST(orders.size() == 2U);
    BOOST_TEST(orders[1].first == 5U);
    BOOST_TEST(orders[1].count == 7U);
    BOOST_TEST(*orders[0].seed == 10U);
    BOOST_TEST(*orders[1].seed == 11U);
    BOOST_TEST(*orders[1].epochs == 3U);
    BOOST_TEST(*orders[1].rate == 0.5);
}

BOOST_AUTO_TEST_CASE(equal_shards_count_alike) {
    const auto mean = sgd::average({part_of("a", 5, 1, {{1, 2}, 3}), part_of("b", 5, 1, {{3, 6}, 9})});
    BOOST_TEST((mean == sgd::classifier{{2, 4}, 6}));
}

BOOST_AUTO_TEST_CASE(a_larger_shard_counts_for_more) {
    const auto mean = sgd::average({part_of("a", 3, 1, {{1, 0}, 4}), part_of("b", 1, 1, {{5, 8}, 0})});
    BOOST_TEST((mean == sgd::classifier{{2, 2}, 3}));
}

BOOST_AUTO_TEST_CASE(a_node_that_is_twice_as_fast_has_shards_twice_as_large) {
    const auto of = sgd::speeds({part_of("fast", 100, 10), part_of("slow", 100, 20)});
    BOOST_TEST((sgd::divide(300, of) == std::vector<sgd::shard>{{0, 200}, {200, 100}}));
}

// Two workers, four shards: the last two waited for the first two.
BOOST_AUTO_TEST_CASE(what_waits_for_a_worker_counts) {
    const auto of = sgd::speeds({part_of("small", 100, 10), part_of("small", 100, 10), part_of("small", 100, 20),
                                 part_of("small", 100, 20), part_of("large", 100, 10)});
    BOOST_TEST(of[0] == of[3]);
    BOOST_TEST(of[0] == 5.0);
    BOOST_TEST(of[4] == 10.0);
}

BOOST_AUTO_TEST_CASE(threads_give_what_one_after_the_other_gives) {
    const sgd::data_set data{sgd::recipe{.per_class = 1'000}};
    const auto orders = sgd::orders_for(sgd::divide(data.size(), {1, 2, 1}), {.epochs = 20, .rate = 1e-3, .seed = 4});
    const auto parts = train_here(data, orders);
    BOOST_TEST(parts.size() == 3U);
    for (std::size_t i = 0; i < parts.size(); ++i) {
        sgd::training alone{
            data, {orders[i].first, orders[i].count}, {.steps = 20 * orders[i].count, .rate = 1e-3, .seed = 4 + i}};
        while (alone.step()) {
        }
        BOOST_TEST((parts[i].result == alone.result()));
        BOOST_TEST(parts[i].points == orders[i].count);
        BOOST_TEST(parts[i].ms > 0);
        BOOST_TEST(*parts[i].after_ms >= parts[i].ms);
    }
}

// The shards' errors differ, so their mean is closer to the best line than each of them.
BOOST_AUTO_TEST_CASE(the_mean_is_better_than_its_parts) {
    const sgd::data_set data{sgd::recipe{.per_class = 10'000}};
    const auto parts = train_here(
        data, sgd::orders_for(sgd::divide(data.size(), {1, 1, 1, 1}), {.epochs = 200, .rate = 1e-3, .seed = 1}));
    double mean = 0;
    for (const auto& part : parts) {
        mean += mean_squared_error(data, part.result) / 4;
    }
    BOOST_TEST(mean_squared_error(data, average(parts)) < mean);
}

BOOST_AUTO_TEST_SUITE_END()
