// SPDX-License-Identifier: BSL-1.0
#include "fmv/ground_radar.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <cstddef>

BOOST_AUTO_TEST_SUITE(ground_radar)

BOOST_AUTO_TEST_CASE(each_scan_is_seen_once_and_the_newest_counts) {
    const fmv::ground_radar radar{3};
    BOOST_TEST(radar.newest(99.5, 100.2).value().utc == 100);
    BOOST_TEST(!radar.newest(100, 100.9).has_value());
    BOOST_TEST(radar.newest(100, 101).value().utc == 101);
    const auto late = radar.newest(100, 103.7).value();
    BOOST_TEST(late.utc == 103);
    const auto same = fmv::ground_radar{3}.newest(102, 103).value();
    BOOST_TEST_REQUIRE(same.plots.size() == late.plots.size());
    for (std::size_t i = 0; i < same.plots.size(); ++i) {
        BOOST_TEST(same.plots[i].east == late.plots[i].east);
        BOOST_TEST(same.plots[i].north == late.plots[i].north);
    }
}

BOOST_AUTO_TEST_CASE(it_sees_most_vehicles_where_they_are_and_some_that_are_none) {
    const fmv::ground_radar radar{4};
    const geo::traffic traffic{4};
    const auto vehicles = traffic.vehicles().size();
    constexpr int scans = 300;
    double plots = 0;
    double squares = 0;
    double compared = 0;
    for (int i = 0; i < scans; ++i) {
        const double utc = 5000 + i;
        const auto scan = radar.newest(utc - 0.5, utc).value();
        plots += static_cast<double>(scan.plots.size());
        if (scan.plots.size() != vehicles + 2) {
            continue; // not all were seen: which plot is whose is not known
        }
        const auto truth = traffic.at(utc);
        for (std::size_t k = 0; k < vehicles; ++k) {
            squares += std::pow(scan.plots[k].east - truth[k].at.east, 2);
            squares += std::pow(scan.plots[k].north - truth[k].at.north, 2);
            compared += 2;
        }
    }
    const double expected = fmv::ground_radar::detected * static_cast<double>(vehicles) + 2;
    BOOST_TEST(std::abs(plots / scans - expected) < 0.3);
    BOOST_TEST_REQUIRE(compared > 500);
    BOOST_TEST(std::abs(std::sqrt(squares / compared) - fmv::ground_radar::deviation) < 0.4);
}

BOOST_AUTO_TEST_SUITE_END()
