// SPDX-License-Identifier: BSL-1.0
#include "geo/camera.hpp"
#include "geo/normal.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <numbers>

namespace camera {
namespace {

constexpr double degree = std::numbers::pi / 180;

geo::camera looking(double azimuth, double depression) {
    return {.at = {.east = 100, .north = -50},
            .height = 1000,
            .azimuth = azimuth * degree,
            .depression = depression * degree,
            .focal_length = 2000,
            .centre_x = 160,
            .centre_y = 120};
}

double distance(geo::plane_position a, geo::plane_position b) { return std::hypot(a.east - b.east, a.north - b.north); }

} // namespace
} // namespace camera

BOOST_AUTO_TEST_SUITE(camera)

BOOST_AUTO_TEST_CASE(straight_down_the_picture_is_a_map) {
    const geo::projection view{looking(0, 90)};
    BOOST_TEST(distance(view.to_ground({160, 120}).value(), {100, -50}) < 1e-9);
    BOOST_TEST(distance(view.to_ground({180, 120}).value(), {110, -50}) < 1e-9); // 20 pixels of 1000 / 2000 m
    BOOST_TEST(distance(view.to_ground({160, 140}).value(), {100, -60}) < 1e-9); // down is south
}

BOOST_AUTO_TEST_CASE(at_an_angle_it_sees_what_is_ahead) {
    const geo::projection east{looking(90, 45)};
    BOOST_TEST(distance(east.to_ground({160, 120}).value(), {1100, -50}) < 1e-9);
    BOOST_TEST(std::abs(east.slant_range() - 1000 * std::sqrt(2.0)) < 1e-9);
    BOOST_TEST(east.to_ground({180, 120})->north < -50); // right of east is south
    BOOST_TEST(east.to_ground({160, 100})->east > 1100); // above the middle is farther away
}

BOOST_AUTO_TEST_CASE(there_and_back_again) {
    for (const double azimuth : {0.0, 77.0, 180.0, -130.0}) {
        for (const double depression : {15.0, 45.0, 80.0, 90.0}) {
            const geo::projection view{looking(azimuth, depression)};
            for (const geo::image_position at : {geo::image_position{0, 0}, {319, 0}, {31, 207}, {319, 239}}) {
                const auto back = view.to_image(view.to_ground(at).value());
                BOOST_TEST_REQUIRE(back.has_value());
                BOOST_TEST(std::hypot(back->x - at.x, back->y - at.y) < 1e-6);
            }
        }
    }
}

BOOST_AUTO_TEST_CASE(the_sky_is_not_on_the_ground_and_what_is_behind_is_not_in_the_picture) {
    const geo::projection view{looking(0, 2)};
    BOOST_TEST(!view.to_ground({160, 0})); // 120 / 2000 rad above the optical axis are 3.4 degrees
    BOOST_TEST(view.to_ground({160, 239}).has_value());
    BOOST_TEST(!view.to_image({100, -1'000'000}));
}

// The formula against the spread of many wrong directions.
BOOST_AUTO_TEST_CASE(the_deviation_is_that_of_wrong_cameras) {
    constexpr double position = 2;
    constexpr double pointing = 1e-3;
    for (const double depression : {30.0, 60.0}) {
        const auto truth = looking(30, depression);
        const auto place = geo::projection{truth}.to_ground({160, 120}).value();
        sgd::random_source chance{7};
        double squares = 0;
        constexpr int count = 4000;
        for (int i = 0; i < count; ++i) {
            auto wrong = truth;
            wrong.at.east += geo::normal(chance) * position;
            wrong.at.north += geo::normal(chance) * position;
            wrong.azimuth += geo::normal(chance) * pointing / std::cos(truth.depression);
            wrong.depression += geo::normal(chance) * pointing;
            const double off = distance(geo::projection{wrong}.to_ground({160, 120}).value(), place);
            squares += off * off / 2;
        }
        const double expected = geo::ground_deviation(truth, position, pointing);
        BOOST_TEST(std::abs(std::sqrt(squares / count) / expected - 1) < 0.03);
    }
}

BOOST_AUTO_TEST_SUITE_END()
