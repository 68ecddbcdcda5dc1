// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/radar_track.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace radar_track {
namespace {

/// A vehicle that brakes with 5 m/s² from the second second on, and one that follows it at a constant speed.
struct scene {
    platoon::radar_setup setup{};
    platoon::radar sensor{setup, 11};
    platoon::radar_track filter{setup};
    platoon::motion ahead{.x = 60, .v = 25, .a = 0}, self{.x = 0, .v = 25, .a = 0};
    double now = 0;
    double squares = 0, speed_squares = 0; ///< of the errors after each measurement
    int count = 0;

    void drive(double seconds) {
        for (const double end = now + seconds; now < end - 1e-9; now += setup.period) {
            const auto seen = sensor.measure({.range = ahead.x - self.x, .rate = ahead.v - self.v});
            filter.measure(*seen, self, now);
            const auto found = filter.at(now);
            squares += std::pow(found.x - ahead.x, 2);
            speed_squares += std::pow(found.v - ahead.v, 2);
            ++count;
            ahead = advance(ahead, now < 2 ? 0 : -5, 0.3, setup.period);
            self = advance(self, 0, 0.3, setup.period);
        }
    }
    void forget() { squares = speed_squares = count = 0; }
};

} // namespace
} // namespace radar_track

BOOST_AUTO_TEST_SUITE(radar_track)

BOOST_AUTO_TEST_CASE(it_is_more_exact_than_the_radar) {
    scene all;
    all.drive(0.5);
    all.forget();
    all.drive(1.5);
    BOOST_TEST(std::sqrt(all.squares / all.count) < all.setup.range_noise / 2);
    BOOST_TEST(std::sqrt(all.speed_squares / all.count) < all.setup.rate_noise);
}

BOOST_AUTO_TEST_CASE(it_finds_the_acceleration) {
    scene all;
    all.drive(2);
    BOOST_TEST(std::abs(all.filter.at(all.now).a) < 0.8);
    all.drive(1.2);
    BOOST_TEST(std::abs(all.filter.at(all.now).a + 5) < 1.5); // the process expects accelerations to end
    BOOST_TEST(std::abs(all.filter.at(all.now).v - all.ahead.v) < 0.2);
}

BOOST_AUTO_TEST_CASE(it_sees_nothing_some_time_after_the_last_echo) {
    platoon::radar_track filter{{}};
    BOOST_TEST(!filter.sees(0));
    filter.measure({.range = 20, .rate = 0}, {.x = 0, .v = 25, .a = 0}, 1);
    BOOST_TEST(filter.sees(1.2));
    BOOST_TEST(!filter.sees(1.4));
}

BOOST_AUTO_TEST_CASE(another_vehicle_in_the_gap_is_taken_as_such) {
    platoon::radar_track filter{{}};
    for (int i = 0; i < 40; ++i) {
        filter.measure({.range = 40, .rate = 0}, {.x = 0, .v = 20, .a = 0}, i * 0.05);
    }
    filter.measure({.range = 12, .rate = -1}, {.x = 0, .v = 20, .a = 0}, 2);
    BOOST_TEST(filter.at(2).x == 12);
    BOOST_TEST(filter.at(2).v == 19);
}

BOOST_AUTO_TEST_SUITE_END()
