// SPDX-License-Identifier: BSL-1.0
#include "serve/vehicle.hpp"

#include <cmath>
#include <numbers>

namespace tool {
namespace {

constexpr double centre_lat = 48.2208;
constexpr double centre_lon = 11.7248;
constexpr double radius = 640;    // m
constexpr double mean_speed = 25; // m/s
constexpr double swing = 4;       // m/s around the mean
constexpr double swing_period = 40;
constexpr double metres_per_degree = 111'320;

double rounded_to(double value, double steps_per_unit) { return std::round(value * steps_per_unit) / steps_per_unit; }

} // namespace

localization vehicle_at(double utc) {
    constexpr double pulse = 2 * std::numbers::pi / swing_period;
    const double way = mean_speed * utc - swing / pulse * std::cos(pulse * utc);
    const double angle = way / radius;
    const double north = radius * std::sin(angle);
    const double east = radius * std::cos(angle);
    return {
        .utc = rounded_to(utc, 1e3),
        .lat = rounded_to(centre_lat + north / metres_per_degree, 1e6),
        .lon = rounded_to(centre_lon + east / (metres_per_degree * std::cos(centre_lat * std::numbers::pi / 180)), 1e6),
        .velocity = rounded_to(mean_speed + swing * std::sin(pulse * utc), 1e2),
        .acceleration = rounded_to(swing * pulse * std::cos(pulse * utc), 1e2),
    };
}

} // namespace tool
