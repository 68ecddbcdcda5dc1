// SPDX-License-Identifier: BSL-1.0
#include "sgd/parallel.hpp"

#include <boost/test/unit_test.hpp>

#include <stdexcept>

namespace parallel {
namespace {

sgd::trained part_of(std::uint64_t points, const sgd::classifier& c) { return {.result = c, .points = points}; }

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

BOOST_AUTO_TEST_CASE(more_shards_than_points_are_refused) {
    BOOST_TEST(sgd::divide(3, {1, 1, 1}).size() == 3U);
    BOOST_CHECK_THROW(sgd::divide(2, {1, 1, 1}), std::invalid_argument);
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
    const auto mean = sgd::average({part_of(5, {{1, 2}, 3}), part_of(5, {{3, 6}, 9})});
    BOOST_TEST((mean == sgd::classifier{{2, 4}, 6}));
}

BOOST_AUTO_TEST_CASE(a_larger_shard_counts_for_more) {
    const auto mean = sgd::average({part_of(3, {{1, 0}, 4}), part_of(1, {{5, 8}, 0})});
    BOOST_TEST((mean == sgd::classifier{{2, 2}, 3}));
}

BOOST_AUTO_TEST_SUITE_END()
