// SPDX-License-Identifier: BSL-1.0
#include "ground_radar.hpp"

#include "geo/normal.hpp"

#include <cmath>

namespace fmv {
namespace {

constexpr int false_plots = 2;    // in each scan
constexpr double half_area = 150; // m: false plots are in the area that it observes

} // namespace

const geo::tangent_plane& ground_radar::plane() {
    static const geo::tangent_plane one{geo::traffic::origin};
    return one;
}

std::optional<radar_scan> ground_radar::newest(double after, double until) const {
    const auto number = static_cast<std::int64_t>(std::floor(until / interval));
    if (static_cast<double>(number) * interval <= after) {
        return std::nullopt;
    }
    return scan_at(number);
}

radar_scan ground_radar::scan_at(std::int64_t number) const {
    sgd::random_source chance{seed_ * 11'000'027 + static_cast<std::uint64_t>(number)};
    radar_scan out{.utc = static_cast<double>(number) * interval, .plots = {}};
    for (const auto& vehicle : traffic_.at(out.utc)) {
        const double east = vehicle.at.east + geo::normal(chance) * deviation;
        const double north = vehicle.at.north + geo::normal(chance) * deviation;
        if (geo::between(chance, 0, 1) < detected) {
            out.plots.push_back({.east = east, .north = north});
        }
    }
    for (int i = 0; i < false_plots; ++i) {
        const double east = chance.within_one() * half_area;
        out.plots.push_back({.east = east, .north = chance.within_one() * half_area});
    }
    return out;
}

} // namespace fmv
