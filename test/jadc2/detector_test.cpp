// SPDX-License-Identifier: BSL-1.0
#include "fmv/detector.hpp"
#include "sgd/random_source.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace detector {
namespace {

constexpr fmv::extent size{.width = 160, .height = 120};
constexpr double noise = 4;

// The sum of twelve is approximately normal.
fmv::grey noisy(std::uint64_t seed) {
    sgd::random_source chance{seed};
    fmv::grey frame(size.pixels());
    for (auto& pixel : frame) {
        double sum = 0;
        for (int i = 0; i < 12; ++i) {
            sum += chance.within_one() / 2;
        }
        pixel = static_cast<std::uint8_t>(std::lround(100 + noise * sum));
    }
    return frame;
}

void add_target(fmv::grey& frame, int left, int top, int width, int height, int contrast) {
    for (int y = top; y < top + height; ++y) {
        for (int x = left; x < left + width; ++x) {
            frame[size.at(x, y)] = static_cast<std::uint8_t>(frame[size.at(x, y)] + contrast);
        }
    }
}

const std::vector<float> flat(size.pixels(), 100.0F);

} // namespace
} // namespace detector

BOOST_AUTO_TEST_SUITE(detector)

BOOST_AUTO_TEST_CASE(noise_is_estimated_and_is_no_target) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        fmv::detector look{size};
        BOOST_TEST(look.look(noisy(seed), flat).empty());
        // A mean of nine rounded values.
        BOOST_TEST(std::abs(look.noise() - std::sqrt(noise * noise + 1.0 / 12) / 3) < 0.1);
    }
}

BOOST_AUTO_TEST_CASE(bright_and_dark_targets_are_found_where_they_are) {
    auto frame = noisy(7);
    add_target(frame, 40, 30, 9, 6, 35);
    add_target(frame, 100, 80, 8, 8, -35);
    fmv::detector look{size};
    const auto& found = look.look(frame, flat);
    BOOST_TEST_REQUIRE(found.size() == 2U);
    BOOST_TEST(std::hypot(found[0].centre.x - 44, found[0].centre.y - 32.5) < 0.7);
    BOOST_TEST(std::hypot(found[1].centre.x - 103.5, found[1].centre.y - 83.5) < 0.7);
    BOOST_TEST(look.moving()[size.at(44, 32)] == 1);
    BOOST_TEST(look.moving()[size.at(70, 60)] == 0);
}

BOOST_AUTO_TEST_CASE(large_targets_hardly_move_the_estimate_of_the_noise) {
    auto frame = noisy(3);
    add_target(frame, 20, 20, 60, 60, 60);
    fmv::detector look{size};
    look.look(frame, flat);
    BOOST_TEST(look.noise() < 2.2);
}

BOOST_AUTO_TEST_CASE(single_pixels_and_changes_of_the_whole_picture_are_none) {
    auto frame = noisy(5);
    frame[size.at(80, 60)] = 180;
    fmv::detector look{size};
    const auto& found = look.look(frame, flat);
    BOOST_TEST((found.empty() || found.front().area <= 9));
    add_target(frame, 10, 10, 140, 100, 50);
    BOOST_TEST(look.look(frame, flat).empty());
}

BOOST_AUTO_TEST_SUITE_END()
