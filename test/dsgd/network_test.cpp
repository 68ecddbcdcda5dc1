// SPDX-License-Identifier: BSL-1.0
#include "digits/model.hpp"
#include "digits/network.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <limits>
#include <stdexcept>

BOOST_AUTO_TEST_SUITE(network)

BOOST_AUTO_TEST_CASE(a_network_computes_scores) {
    // Two inputs, two hidden values, two classes.
    const digits::network n{.form = {.inputs = 2, .hidden = 2, .classes = 2},
                            .weights = {1, -1, 2, 0, 0.5F, 1, 3, 4, 5, 6, 0.25F, -0.25F}};
    BOOST_TEST(n.form.weights() == n.weights.size());
    digits::forward_pass pass{n.form};
    const float image[] = {1, 0.5F};
    pass.run(n, image);
    BOOST_TEST(pass.hidden()[0] == 2.5F); // 0.5 + 1 * 1 + 0.5 * 2
    BOOST_TEST(pass.hidden()[1] == 0.0F); // 1 + 1 * -1 + 0.5 * 0
    BOOST_TEST(pass.scores()[0] == 7.75F);
    BOOST_TEST(pass.scores()[1] == 9.75F);
    const float dark[] = {0, 0};
    pass.run(n, dark);
    BOOST_TEST(pass.hidden()[0] == 0.5F);
    BOOST_TEST(pass.hidden()[1] == 1.0F);
}

BOOST_AUTO_TEST_CASE(a_seed_makes_the_same_weights) {
    const digits::shape form{.inputs = 4, .hidden = 3, .classes = 2};
    const auto n = digits::made(form, 1);
    BOOST_TEST((n == digits::made(form, 1)));
    BOOST_TEST((n != digits::made(form, 2)));
    BOOST_TEST(n.weights[12] == 0.0F); // the biases
    BOOST_TEST(n.weights.back() == 0.0F);
    for (const auto weight : n.weights) {
        BOOST_TEST(std::abs(weight) < 1.5F);
    }
}

BOOST_AUTO_TEST_CASE(shapes_are_limited) {
    BOOST_CHECK_THROW(digits::made({.inputs = 0, .hidden = 3, .classes = 2}, 1), std::invalid_argument);
    BOOST_CHECK_THROW(digits::made({.inputs = 4, .hidden = 0, .classes = 2}, 1), std::invalid_argument);
    BOOST_CHECK_THROW(digits::made({.inputs = 4, .hidden = 3, .classes = 1}, 1), std::invalid_argument);
    BOOST_CHECK_THROW(digits::made({.inputs = 4'294'967'295, .hidden = 4'294'967'295, .classes = 2}, 1),
                      std::invalid_argument);
    BOOST_CHECK_NO_THROW(digits::check({.inputs = 784, .hidden = 200, .classes = 10}));
    BOOST_CHECK_THROW(digits::check({.inputs = 784, .hidden = 300, .classes = 10}), std::invalid_argument);
}

BOOST_AUTO_TEST_CASE(the_mean_counts_by_weights) {
    const digits::shape form{.inputs = 1, .hidden = 1, .classes = 2};
    const digits::network one{.form = form, .weights = {1, 2, 3, 4, 5, 6}};
    const digits::network other{.form = form, .weights = {5, 6, 7, 8, 9, 10}};
    const auto mean = digits::average({{.of = &one, .weight = 3}, {.of = &other, .weight = 1}});
    BOOST_TEST((mean.weights == std::vector<float>{2, 3, 4, 5, 6, 7}));
    BOOST_TEST((digits::average({{.of = &one, .weight = 0.3}}) == one));
}

BOOST_AUTO_TEST_CASE(a_network_travels_exactly) {
    auto n = digits::made({.inputs = 4, .hidden = 3, .classes = 2}, 7);
    n.weights[0] = -0.0F;
    n.weights[1] = std::numeric_limits<float>::denorm_min();
    n.weights[2] = std::numeric_limits<float>::max();
    const auto sent = digits::to_model(n);
    BOOST_TEST((digits::from_model(sent) == n));
    BOOST_TEST(std::signbit(digits::from_model(sent).weights[0]));
    digits::network one{.form = {.inputs = 1, .hidden = 1, .classes = 2}, .weights = {1, 0, 0, 0, 0, 0}};
    BOOST_TEST(digits::to_model(one).weights == "AACAPwAAAAAAAAAAAAAAAAAAAAAAAAAA"); // 1 is 00 00 80 3f
}

BOOST_AUTO_TEST_CASE(what_is_no_network_is_refused) {
    const auto good = digits::to_model(digits::made({.inputs = 4, .hidden = 3, .classes = 2}, 7));
    auto bad = good;
    bad.hidden = 4;
    BOOST_CHECK_THROW(digits::from_model(bad), std::invalid_argument);
    bad = good;
    bad.weights.pop_back();
    BOOST_CHECK_THROW(digits::from_model(bad), std::invalid_argument);
    bad = good;
    bad.weights[3] = '*';
    BOOST_CHECK_THROW(digits::from_model(bad), std::invalid_argument);
    bad = good;
    bad.inputs = 4'000'000'000;
    BOOST_CHECK_THROW(digits::from_model(bad), std::invalid_argument);
    auto infinite = digits::from_model(good);
    infinite.weights[5] = std::numeric_limits<float>::infinity();
    BOOST_CHECK_THROW(digits::from_model(digits::to_model(infinite)), std::invalid_argument);
}

BOOST_AUTO_TEST_SUITE_END()
