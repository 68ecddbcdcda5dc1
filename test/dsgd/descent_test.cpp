// SPDX-License-Identifier: BSL-1.0
#include "digits/descent.hpp"
#include "images.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace descent {
namespace {

using dsgd_test::rows_of_pixels;

digits::network trained(const digits::image_set& images, const digits::network& start, const digits::schedule& how) {
    digits::descent work{images, start, how};
    while (work.step()) {
    }
    return work.result();
}

double loss_of(const digits::network& n, const digits::image_set& images) {
    digits::forward_pass pass{n.form};
    pass.run(n, images.image(0));
    double sum = 0;
    for (const auto score : pass.scores()) {
        sum += std::exp(static_cast<double>(score));
    }
    return std::log(sum) - static_cast<double>(pass.scores()[images.class_of(0)]);
}

const digits::shape form{.inputs = 9, .hidden = 8, .classes = 3};

} // namespace
} // namespace descent

BOOST_AUTO_TEST_SUITE(descent)

// The step is compared with the slope of the loss, found by small changes of each weight.
BOOST_AUTO_TEST_CASE(a_step_goes_against_the_gradient) {
    const auto images = descent::rows_of_pixels(1, 3);
    const auto start = digits::made(descent::form, 5);
    constexpr double rate = 1e-2;
    const auto after = descent::trained(images, start, {.passes = 1, .rate = rate, .seed = 1});
    for (std::size_t i = 0; i < start.weights.size(); ++i) {
        constexpr float change = 1e-2F;
        auto more = start;
        auto less = start;
        more.weights[i] += change;
        less.weights[i] -= change;
        const auto slope = (descent::loss_of(more, images) - descent::loss_of(less, images)) / (2 * change);
        const auto moved = static_cast<double>(start.weights[i] - after.weights[i]) / rate;
        BOOST_TEST(std::abs(moved - slope) < 2e-3, "weight " << i << ": " << moved << " instead of " << slope);
    }
}

BOOST_AUTO_TEST_CASE(each_pass_takes_each_image_once) {
    const auto images = descent::rows_of_pixels(300, 3);
    digits::descent work{images, digits::made(descent::form, 5), {.passes = 2, .rate = 0.05, .seed = 1}};
    BOOST_TEST(work.part_done() == 0);
    double last = 0;
    while (work.step()) {
        BOOST_TEST(work.part_done() > last);
        last = work.part_done();
    }
    BOOST_TEST(work.part_done() == 1);
    BOOST_TEST(work.steps() == 600U);
    BOOST_TEST(!work.step());
}

BOOST_AUTO_TEST_CASE(it_learns) {
    const auto images = descent::rows_of_pixels(300, 3);
    const auto test = descent::rows_of_pixels(200, 4);
    const auto start = digits::made(descent::form, 5);
    digits::descent first{images, start, {.passes = 1}};
    while (first.step()) {
    }
    const auto after = descent::trained(images, first.result(), {.passes = 5, .seed = 2});
    digits::descent last{images, after, {.passes = 1, .rate = 1e-12}};
    while (last.step()) {
    }
    BOOST_TEST(last.mean_loss() < first.mean_loss() / 2);
    BOOST_TEST(accuracy(after, test) > 0.95);
    BOOST_TEST(accuracy(after, test) > accuracy(start, test));
}

BOOST_AUTO_TEST_CASE(the_seed_decides_the_order) {
    const auto images = descent::rows_of_pixels(100, 3);
    const auto start = digits::made(descent::form, 5);
    const auto with_seed = [&](std::uint64_t seed) {
        return descent::trained(images, start, {.passes = 2, .rate = 0.05, .seed = seed});
    };
    BOOST_TEST((with_seed(1) == with_seed(1)));
    BOOST_TEST((with_seed(1) != with_seed(2)));
}

BOOST_AUTO_TEST_CASE(a_rate_that_is_too_large_shows) {
    const auto images = descent::rows_of_pixels(300, 3);
    for (const auto rate : {100.0, 1e6, 1e30}) {
        digits::descent work{images, digits::made(descent::form, 5), {.passes = 2, .rate = rate}};
        while (work.step()) {
        }
        BOOST_TEST(work.diverged(), rate);
    }
    digits::descent good{images, digits::made(descent::form, 5), {.passes = 2}};
    while (good.step()) {
    }
    BOOST_TEST(!good.diverged());
}

BOOST_AUTO_TEST_SUITE_END()
