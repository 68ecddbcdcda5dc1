// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/radar_track.hpp"

#include <cmath>

namespace platoon {
namespace {

constexpr double persistence = 1;     // s, for which an acceleration typically lasts
constexpr double manoeuvring = 1.5;   // m/s², its standard deviation
constexpr double another_vehicle = 4; // m, by which the range of the same vehicle never jumps

} // namespace

void radar_track::measure(const echo& seen, const motion& self, double now) {
    const double place = self.x + seen.range;
    const double speed = self.v + seen.rate;
    const double range_variance = setup_.range_noise * setup_.range_noise + 1e-8;
    const double rate_variance = setup_.rate_noise * setup_.rate_noise + 1e-8;
    if (!sees(now) || std::abs(at(now).x - place) > another_vehicle) {
        estimate_ = {place, speed, 0};
        variance_ = {};
        variance_[0][0] = range_variance;
        variance_[1][1] = rate_variance;
        variance_[2][2] = manoeuvring * manoeuvring;
    } else {
        predict(now - measured_);
        correct(0, place, range_variance);
        correct(1, speed, rate_variance);
    }
    known_ = true;
    measured_ = now;
}

motion radar_track::at(double now) const {
    const double dt = now - measured_;
    return {.x = estimate_[0] + estimate_[1] * dt + estimate_[2] * dt * dt / 2,
            .v = estimate_[1] + estimate_[2] * dt,
            .a = estimate_[2] * std::exp(-dt / persistence)};
}

void radar_track::predict(double dt) {
    const auto moved = at(measured_ + dt);
    estimate_ = {moved.x, moved.v, moved.a};
    const double rest = std::exp(-dt / persistence);
    const std::array<std::array<double, 3>, 3> change{{{1, dt, dt * dt / 2}, {0, 1, dt}, {0, 0, rest}}};
    std::array<std::array<double, 3>, 3> half{};
    std::array<std::array<double, 3>, 3> next{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t m = 0; m < 3; ++m) {
                half[i][k] += change[i][m] * variance_[m][k];
            }
        }
    }
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t m = 0; m < 3; ++m) {
                next[i][k] += half[i][m] * change[k][m];
            }
        }
    }
    // The acceleration has changed by then, on average halfway.
    const double jolt = manoeuvring * manoeuvring * (1 - rest * rest);
    const std::array<double, 3> effect{dt * dt / 6, dt / 2, 1};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            next[i][k] += jolt * effect[i] * effect[k];
        }
    }
    variance_ = next;
}

void radar_track::correct(std::size_t component, double measured, double variance) {
    const double difference = measured - estimate_[component];
    const auto row = variance_[component];
    const double total = row[component] + variance;
    for (std::size_t i = 0; i < 3; ++i) {
        const double gain = variance_[i][component] / total;
        estimate_[i] += gain * difference;
        for (std::size_t k = 0; k < 3; ++k) {
            variance_[i][k] -= gain * row[k];
        }
    }
}

} // namespace platoon
