// SPDX-License-Identifier: BSL-1.0
#include "dsgd/local.hpp"
#include "sgd/parallel.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(local)

BOOST_AUTO_TEST_CASE(threads_give_what_one_after_the_other_gives) {
    const sgd::data_set data{sgd::recipe{.per_class = 1'000}};
    const auto orders = sgd::orders_for(sgd::divide(data.size(), {1, 2, 1}), {.epochs = 20, .rate = 1e-3, .seed = 4});
    const auto parts = dsgd::train_here(data, orders);
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
    const auto parts = dsgd::train_here(
        data, sgd::orders_for(sgd::divide(data.size(), {1, 1, 1, 1}), {.epochs = 200, .rate = 1e-3, .seed = 1}));
    double mean = 0;
    for (const auto& part : parts) {
        mean += mean_squared_error(data, part.result) / 4;
    }
    BOOST_TEST(mean_squared_error(data, average(parts)) < mean);
}

BOOST_AUTO_TEST_SUITE_END()
