// SPDX-License-Identifier: BSL-1.0
#include "strike/engagement.hpp"
#include "strike/own_sensor.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cmath>

namespace own_sensor {
namespace {

const auto here = strike::default_state().at;

bool same(const strike::scan& a, const strike::scan& b) {
    return a.utc == b.utc && a.plots.size() == b.plots.size() && a.plots.front().at.east == b.plots.front().at.east;
}

} // namespace
} // namespace own_sensor

BOOST_AUTO_TEST_SUITE(own_sensor)

BOOST_AUTO_TEST_CASE(what_it_has_seen_does_not_depend_on_when_it_is_asked) {
    strike::own_sensor often{3, here};
    for (int i = 0; i < 25; ++i) {
        const double utc = 1'000'000 + i * 0.17;
        const auto& scans = often.last(30, utc);
        strike::own_sensor once{3, here};
        const auto& fresh = once.last(30, utc);
        BOOST_TEST_REQUIRE(scans.size() == 30U);
        BOOST_TEST_REQUIRE(fresh.size() == 30U);
        for (std::size_t k = 0; k < scans.size(); ++k) {
            BOOST_TEST_REQUIRE(same(scans[k], fresh[k]));
        }
        BOOST_TEST(scans.back().utc <= utc);
        BOOST_TEST(scans.back().utc > utc - strike::own_sensor::interval);
    }
    BOOST_TEST(often.last(5, 1'000'000).size() == 5U); // and back in time
    BOOST_TEST(often.last(0, 1'000'003).empty());
}

BOOST_AUTO_TEST_CASE(it_sees_most_vehicles_where_they_are_and_some_that_are_none) {
    strike::own_sensor sensor{4, here};
    const geo::traffic traffic{4};
    const geo::tangent_plane ground{geo::traffic::origin};
    double seen = 0;
    double false_plots = 0;
    double squares = 0;
    const auto& scans = sensor.last(100, 5000);
    for (const auto& scan : scans) {
        const auto truth = traffic.at(scan.utc);
        for (const auto& plot : scan.plots) {
            double nearest = 1e9;
            for (const auto& vehicle : truth) {
                const auto at = sensor.plane().to_plane(ground.to_geographic(vehicle.at));
                const double east = plot.at.east - at.east;
                const double north = plot.at.north - at.north;
                const auto& n = plot.noise;
                const double determinant = n.ee * n.nn - n.en * n.en;
                nearest = std::min(nearest,
                                   (n.nn * east * east - 2 * n.en * east * north + n.ee * north * north) / determinant);
            }
            (nearest < 16 ? seen : false_plots) += 1;
            squares += nearest < 16 ? nearest : 0;
        }
    }
    BOOST_TEST(std::abs(seen / (100.0 * 10) - 0.9) < 0.04); // with a false plot near a vehicle now and then
    BOOST_TEST(std::abs(false_plots / 100 - 1) < 0.1);
    BOOST_TEST(std::abs(squares / seen - 2) < 0.2); // the noise is as large as it says
}

BOOST_AUTO_TEST_SUITE_END()
