// SPDX-License-Identifier: BSL-1.0
#include "sgd/training.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>

namespace training {
namespace {

const sgd::data_set data{sgd::recipe{.per_class = 10'000}};

sgd::classifier trained(sgd::shard part, const sgd::schedule& how, const sgd::classifier& start = {}) {
    sgd::training work{data, part, how, start};
    while (work.step()) {
    }
    return work.result();
}

} // namespace
} // namespace training

BOOST_AUTO_TEST_SUITE(training)

// A second implementation of algorithm 1.
BOOST_AUTO_TEST_CASE(each_step_goes_against_the_gradient_at_a_drawn_point) {
    sgd::random_source chance{5};
    sgd::classifier c;
    for (int t = 0; t < 50'000; ++t) {
        const auto i = 100 + std::size_t{chance.below(300)};
        const auto error = c.weights[0] * data[i].x + c.weights[1] * data[i].y + c.bias - double(i % 2);
        const auto pull = 0.001 * error;
        c = {.weights = {c.weights[0] - pull * data[i].x, c.weights[1] - pull * data[i].y}, .bias = c.bias - pull};
    }
    BOOST_TEST((trained({100, 300}, {.steps = 50'000, .rate = 0.001, .seed = 5}) == c));
}

BOOST_AUTO_TEST_CASE(it_comes_near_the_best_line) {
    const auto q = judge(data, trained({0, 20'000}, {.steps = 2'000'000}));
    BOOST_TEST(q.mse < q.least_mse * 1.005);
}

BOOST_AUTO_TEST_CASE(the_seed_says_what_is_drawn) {
    const sgd::schedule how{.steps = 1'000, .seed = 1};
    const sgd::schedule other{.steps = 1'000, .seed = 2};
    BOOST_TEST((trained({0, 20'000}, how) == trained({0, 20'000}, how)));
    BOOST_TEST((trained({0, 20'000}, how) != trained({0, 20'000}, other)));
}

BOOST_AUTO_TEST_CASE(it_goes_on_from_where_it_is_told) {
    const sgd::classifier start{.weights = {1, -1}, .bias = 2};
    BOOST_TEST((trained({0, 1}, {.steps = 0}, start) == start));
    BOOST_TEST((trained({0, 20'000}, {.steps = 1}, start) != start));
}

BOOST_AUTO_TEST_CASE(it_tells_how_far_it_is) {
    sgd::training work{data, {0, 20'000}, {.steps = 100'000}};
    BOOST_TEST(work.part_done() == 0);
    double last = 0;
    while (work.step()) {
        BOOST_TEST(work.part_done() > last);
        BOOST_TEST(work.part_done() < 1);
        last = work.part_done();
    }
    BOOST_TEST(last > 0.8);
    BOOST_TEST(work.part_done() == 1);
    BOOST_TEST(!work.step());
}

BOOST_AUTO_TEST_CASE(a_rate_that_is_too_large_shows) {
    sgd::training work{data, {0, 20'000}, {.steps = 100'000, .rate = 1}};
    BOOST_TEST(sgd::is_finite(work.result()));
    while (work.step()) {
    }
    BOOST_TEST(!sgd::is_finite(work.result()));
}

BOOST_AUTO_TEST_SUITE_END()
