// SPDX-License-Identifier: BSL-1.0
#include "fmv/ground_grid.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ground_grid {
namespace {

constexpr fmv::extent size{.width = 160, .height = 120};
constexpr double degree = std::numbers::pi / 180;

// On a circle around the origin, at which it looks.
geo::camera circling(double bearing) {
    return {.at = {.east = 500 * std::sin(bearing * degree), .north = 500 * std::cos(bearing * degree)},
            .height = 900,
            .azimuth = (bearing + 180) * degree,
            .depression = std::atan2(900, 500),
            .focal_length = 2000,
            .centre_x = size.width / 2.0,
            .centre_y = size.height / 2.0};
}

// Smooth, and different everywhere.
double brightness(geo::plane_position at) { return 128 + 60 * std::sin(at.east / 7) + 50 * std::cos(at.north / 9); }

fmv::grey picture_from(const geo::camera& from) {
    const geo::projection view{from};
    fmv::grey out(size.pixels());
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
            const auto at = view.to_ground({.x = static_cast<double>(x), .y = static_cast<double>(y)});
            out[size.at(x, y)] = static_cast<std::uint8_t>(std::lround(brightness(at.value())));
        }
    }
    return out;
}

double difference(const fmv::ground_grid& grid, const fmv::rectified& map, double& part) {
    double most = 0;
    double count = 0;
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
            if (map.seen[size.at(x, y)] != 0) {
                const auto at = grid.to_ground({.x = static_cast<double>(x), .y = static_cast<double>(y)});
                most = std::max(most, std::abs(map.pixels[size.at(x, y)] - brightness(at)));
                ++count;
            }
        }
    }
    part = count / static_cast<double>(size.pixels());
    return most;
}

} // namespace
} // namespace ground_grid

BOOST_AUTO_TEST_SUITE(ground_grid)

BOOST_AUTO_TEST_CASE(from_everywhere_the_ground_looks_the_same) {
    const fmv::ground_grid grid{circling(20), size};
    for (const double bearing : {20.0, 25.0, 65.0, 110.0, 200.0}) {
        double part = 0;
        BOOST_TEST(difference(grid, grid.rectify(picture_from(circling(bearing)), circling(bearing), {}), part) < 2);
        BOOST_TEST(part > 0.7, "from " << bearing << " degrees, " << part << " of the map are seen");
    }
}

BOOST_AUTO_TEST_CASE(a_correction_moves_the_map) {
    const fmv::ground_grid grid{circling(20), size};
    const auto frame = picture_from(circling(20));
    const auto map = grid.rectify(frame, circling(20), {});
    const auto moved = grid.rectify(frame, circling(20), {.x = 3, .y = -2});
    for (int y = 40; y < 80; ++y) {
        for (int x = 40; x < 120; ++x) {
            BOOST_TEST_REQUIRE(std::abs(moved.pixels[size.at(x + 3, y - 2)] - map.pixels[size.at(x, y)]) <= 1);
        }
    }
}

BOOST_AUTO_TEST_CASE(squares_are_metres) {
    const fmv::ground_grid grid{circling(90), size}; // it looks to the west
    BOOST_TEST(std::abs(grid.cell() - std::hypot(900, 500) / 2000) < 1e-9);
    const auto middle = grid.to_ground({.x = 80, .y = 60});
    BOOST_TEST(std::hypot(middle.east, middle.north) < 1e-9);
    BOOST_TEST(std::abs(grid.to_ground({.x = 90, .y = 60}).north - 10 * grid.cell()) < 1e-9);
    BOOST_TEST(std::abs(grid.movement({.x = 0, .y = -2}).east + 2 * grid.cell()) < 1e-9);
    const auto back = grid.to_grid(grid.to_ground({.x = 12, .y = 99}));
    BOOST_TEST(std::hypot(back.x - 12, back.y - 99) < 1e-9);
}

BOOST_AUTO_TEST_CASE(what_a_frame_does_not_show_is_not_seen) {
    const fmv::ground_grid grid{circling(20), size};
    auto away = circling(20);
    away.azimuth += 90 * degree;
    const auto map = grid.rectify(picture_from(circling(20)), away, {});
    BOOST_TEST(std::count(map.seen.begin(), map.seen.end(), 0) == static_cast<std::ptrdiff_t>(size.pixels()));
}

BOOST_AUTO_TEST_SUITE_END()
