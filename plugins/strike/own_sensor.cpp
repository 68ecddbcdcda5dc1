// SPDX-License-Identifier: BSL-1.0
#include "own_sensor.hpp"

#include "geo/normal.hpp"

#include <cmath>

namespace strike {
namespace {

constexpr double range_noise = 1.5;    // m, standard deviation
constexpr double azimuth_noise = 1e-3; // rad, the same
constexpr double detected = 0.9;       // the share of vehicles in a scan
constexpr int false_plots = 1;         // in each scan
constexpr double half_area = 150;      // m: false plots are in the area that it observes

plot measured(geo::plane_position truth, sgd::random_source& chance) {
    const double range = std::hypot(truth.east, truth.north);
    const double azimuth = std::atan2(truth.east, truth.north) + geo::normal(chance) * azimuth_noise;
    const double seen = range + geo::normal(chance) * range_noise;
    const double sine = std::sin(azimuth);
    const double cosine = std::cos(azimuth);
    const double along = range_noise * range_noise;
    const double across = range * azimuth_noise * range * azimuth_noise;
    return {.at = {.east = seen * sine, .north = seen * cosine},
            .noise = {.ee = along * sine * sine + across * cosine * cosine,
                      .en = (along - across) * sine * cosine,
                      .nn = along * cosine * cosine + across * sine * sine}};
}

} // namespace

own_sensor::own_sensor(std::uint64_t seed, geo::geographic from)
    : seed_(seed), traffic_(seed), plane_(from), middle_(plane_.to_plane(geo::traffic::origin)) {}

const std::vector<scan>& own_sensor::last(std::uint64_t count, double utc) {
    const auto newest = static_cast<std::int64_t>(std::floor(utc / interval));
    const auto first = newest - static_cast<std::int64_t>(count) + 1;
    const auto known_first = newest_ - static_cast<std::int64_t>(kept_.size()) + 1;
    if (known_first > first || newest_ > newest || newest_ < first) {
        kept_.clear();
        newest_ = first - 1;
    } else {
        kept_.erase(kept_.begin(), kept_.begin() + (first - known_first));
    }
    while (newest_ < newest) {
        kept_.push_back(scan_at(++newest_));
    }
    return kept_;
}

scan own_sensor::scan_at(std::int64_t number) const {
    sgd::random_source chance{seed_ * 9'000'011 + static_cast<std::uint64_t>(number)};
    scan out{.utc = static_cast<double>(number) * interval, .plots = {}};
    for (const auto& vehicle : traffic_.at(out.utc)) {
        // Within a kilometre, two planes differ by a shift, and some centimetres.
        const auto seen =
            measured({.east = middle_.east + vehicle.at.east, .north = middle_.north + vehicle.at.north}, chance);
        if (geo::between(chance, 0, 1) < detected) {
            out.plots.push_back(seen);
        }
    }
    for (int i = 0; i < false_plots; ++i) {
        out.plots.push_back(measured({.east = middle_.east + chance.within_one() * half_area,
                                      .north = middle_.north + chance.within_one() * half_area},
                                     chance));
    }
    return out;
}

} // namespace strike
