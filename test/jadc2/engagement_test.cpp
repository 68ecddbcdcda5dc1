// SPDX-License-Identifier: BSL-1.0
// What the aircraft's own fusion has to achieve, from the pixels to the impact: of 100 strikes 95 hit, and by the track
// alone at most 70 do.
#include "jadc2/rehearsal.hpp"
#include "jadc2/vehicle_order.hpp"
#include "strike/engagement.hpp"
#include "support/amount.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace engagement {
namespace {

constexpr std::uint64_t strikes = cles::test::amount(100U, 12U);

using jadc2::test::order_for;

double missed_by(const strike::aim& aimed, const geo::traffic& traffic, std::size_t vehicle, double released) {
    const auto truth = traffic.at(released + aimed.after_s)[vehicle].at;
    const auto at = geo::tangent_plane{geo::traffic::origin}.to_plane(aimed.at);
    return std::hypot(at.east - truth.east, at.north - truth.north);
}

} // namespace
} // namespace engagement

BOOST_AUTO_TEST_SUITE(engagement)

BOOST_AUTO_TEST_CASE(of_a_hundred_strikes_most_hit_with_fusion_and_many_miss_without) {
    const auto [fused, alone] = jadc2::rehearse({.strikes = strikes});
    for (const auto& record : {fused, alone}) {
        BOOST_TEST_MESSAGE(record.hits << " of " << record.strikes << " hit, median " << record.median_missed_by
                                       << " m, 95 % within " << record.p95_missed_by << " m, sigma "
                                       << record.observed_sigma << " m instead of " << record.expected_sigma << " m");
        BOOST_TEST(record.strikes == strikes);
        BOOST_TEST(record.observed_sigma < 1.5 * record.expected_sigma); // it knows how accurate it is
    }
    // Of a few, more may miss or hit by chance.
    BOOST_TEST(static_cast<double>(fused.hits) >= cles::test::amount(0.95, 0.9) * static_cast<double>(strikes));
    constexpr double most = cles::test::amount(0.7, 0.95);
    BOOST_TEST(static_cast<double>(alone.hits) <= most * static_cast<double>(strikes));
}

BOOST_AUTO_TEST_CASE(the_error_of_a_track_is_corrected_by_own_plots) {
    const geo::traffic traffic{1};
    const double utc = 700;
    const auto own = strike::default_state();
    strike::own_sensor sensor{1, own.at};
    int strikes_near_the_middle = 0;
    for (std::size_t i = 0; i < traffic.vehicles().size(); ++i) {
        if (const auto at = traffic.at(utc)[i].at; std::hypot(at.east, at.north) > 100) {
            continue; // it might leave its road before the impact
        }
        ++strikes_near_the_middle;
        const auto what = order_for(traffic.at(utc)[i], utc, {.east = 2, .north = -3});
        const auto fused = strike::engage(what, utc + 0.5, own, sensor);
        BOOST_TEST_REQUIRE(fused.has_value());
        BOOST_TEST(fused->plots > 15U);
        BOOST_TEST(fused->sigma < 2);
        BOOST_TEST(missed_by(*fused, traffic, i, utc + 0.5) < 5);
    }
    BOOST_TEST(strikes_near_the_middle >= 2);
}

BOOST_AUTO_TEST_CASE(what_its_sensor_does_not_see_is_struck_by_the_track_alone) {
    const geo::traffic traffic{1};
    const double utc = 700;
    const auto own = strike::default_state();
    strike::own_sensor elsewhere{2, own.at}; // other vehicles
    const auto what = order_for({.at = {.east = 300, .north = 300}, .velocity = {.east = 10, .north = 0}}, utc, {});
    const auto hit = strike::engage(what, utc, own, elsewhere);
    BOOST_TEST_REQUIRE(hit.has_value());
    BOOST_TEST(hit->plots == 0U);
    BOOST_TEST(hit->sigma > 3);
    const auto at = geo::tangent_plane{geo::traffic::origin}.to_plane(hit->at);
    BOOST_TEST(std::abs(at.east - (300 + 10 * hit->after_s)) < 0.1);
    BOOST_TEST(std::abs(at.north - 300) < 0.1);
}

BOOST_AUTO_TEST_SUITE_END()
