// SPDX-License-Identifier: BSL-1.0
#include "geo/tangent_plane.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <cmath>

BOOST_AUTO_TEST_SUITE(tangent_plane)

// The lengths of a degree on WGS 84, as geographic tables list them.
BOOST_AUTO_TEST_CASE(a_degree_has_its_known_length) {
    struct row {
        double lat, north, east; // km
    };
    for (const auto& each : {row{0, 110.574, 111.320}, row{45, 111.132, 78.847}, row{60, 111.412, 55.800}}) {
        const geo::tangent_plane south{{.lat = each.lat - 0.5, .lon = 11}};
        BOOST_TEST(std::abs(south.to_plane({.lat = each.lat + 0.5, .lon = 11}).north / 1000 - each.north) < 0.001);
        const geo::tangent_plane west{{.lat = each.lat, .lon = -0.5}};
        BOOST_TEST(std::abs(west.to_plane({.lat = each.lat, .lon = 0.5}).east / 1000 - each.east) < 0.001);
    }
}

BOOST_AUTO_TEST_CASE(there_and_back_it_is_the_same_place) {
    const geo::tangent_plane plane{{.lat = 48.137, .lon = 11.575}};
    for (const double east : {-15000.0, -1.0, 0.0, 700.0, 15000.0}) {
        for (const double north : {-15000.0, 0.0, 3.0, 15000.0}) {
            const auto back = plane.to_plane(plane.to_geographic({.east = east, .north = north}));
            BOOST_TEST(std::abs(back.east - east) < 1e-6);
            BOOST_TEST(std::abs(back.north - north) < 1e-6);
        }
    }
}

// The chord through the ellipsoid is an independent measure of a short distance.
BOOST_AUTO_TEST_CASE(ten_kilometres_away_distances_are_right_within_a_thousandth) {
    const auto in_space = [](const geo::geographic& at) {
        const double degree = std::acos(-1.0) / 180;
        const double squared = 0.00669437999014;
        const double radius = 6378137 / std::sqrt(1 - squared * std::pow(std::sin(at.lat * degree), 2));
        return std::array<double, 3>{radius * std::cos(at.lat * degree) * std::cos(at.lon * degree),
                                     radius * std::cos(at.lat * degree) * std::sin(at.lon * degree),
                                     radius * (1 - squared) * std::sin(at.lat * degree)};
    };
    const geo::tangent_plane plane{{.lat = 48.137, .lon = 11.575}};
    for (const double direction : {0.0, 0.5, 1.0, 1.57}) {
        const auto at = [&](double x) {
            return in_space(plane.to_geographic({.east = x * std::sin(direction), .north = x * std::cos(direction)}));
        };
        const auto a = at(10000);
        const auto b = at(10015);
        const double distance = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
        BOOST_TEST(std::abs(distance - 15) < 0.015, distance);
    }
}

BOOST_AUTO_TEST_SUITE_END()
