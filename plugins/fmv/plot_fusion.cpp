// SPDX-License-Identifier: BSL-1.0
#include "plot_fusion.hpp"

#include "track_digits.hpp"

#include <cmath>

namespace fmv {
namespace {

// Neighbours that the camera does not see, and false plots: about as many as there are vehicles on the roads.
constexpr double other_plots = 3e-4; // per m²

} // namespace

std::optional<place_shift> plot_fusion::correct(std::vector<track>& tracks, const stream::place_error& of, double utc) {
    if (!error_ || map_ != of.map) {
        error_.emplace(of.common);
        map_ = of.map;
        looked_ = utc;
    }
    look(tracks, utc);
    if (!error_->is_known()) {
        return std::nullopt;
    }
    const auto mean = error_->mean();
    const place_shift by{.east = hundredths(mean.east), .north = hundredths(mean.north)};
    const double sigma = stated_deviation(std::hypot(error_->deviation(), of.own));
    const auto& plane = ground_radar::plane();
    for (auto& each : tracks) {
        const auto seen = plane.to_plane({.lat = each.lat, .lon = each.lon});
        const auto place = plane.to_geographic({.east = seen.east - by.east, .north = seen.north - by.north});
        each.lat = to_a_centimetre(place.lat);
        each.lon = to_a_centimetre(place.lon);
        each.sigma = sigma;
    }
    return by;
}

// Where targets were when the radar saw them: those that the last frame shows, moved back.
void plot_fusion::look(const std::vector<track>& tracks, double utc) {
    const auto scan = radar_.newest(looked_, utc);
    if (!scan) {
        return;
    }
    looked_ = scan->utc;
    const double since = utc - scan->utc;
    std::vector<geo::plane_position> places;
    for (const auto& each : tracks) {
        if (each.missed == 0) {
            const auto now = ground_radar::plane().to_plane({.lat = each.lat, .lon = each.lon});
            places.push_back({.east = now.east - each.ve * since, .north = now.north - each.vn * since});
        }
    }
    error_->observe(places, scan->plots,
                    {.deviation = ground_radar::deviation, .detected = ground_radar::detected, .others = other_plots});
}

} // namespace fmv
