// SPDX-License-Identifier: BSL-1.0
#include "track_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace jadc2 {
namespace {

constexpr double edge = 20; // pixels from the edge of a picture: vehicles nearer to it may be seen in part
constexpr int settled = 10; // frames after which a vehicle in sight has to be found
constexpr double far_away = std::numeric_limits<double>::max();

bool is_inside(fmv::point at) {
    return at.x >= edge && at.y >= edge && at.x <= scene::size.width - edge && at.y <= scene::size.height - edge;
}

fmv::point in_picture(const geo::projection& view, geo::plane_position at) {
    const auto out = view.to_image(at);
    return out ? fmv::point{.x = out->x, .y = out->y} : fmv::point{.x = far_away, .y = far_away};
}

} // namespace

void track_evaluation::begin(std::uint64_t number, double utc) {
    true_view_.emplace(scene_.camera(number, utc));
    const auto reported = fmv::to_camera(scene_.reported(utc), scene::size, scene::plane());
    reported_view_.emplace(reported);
    map_.emplace(reported, scene::size);
    std::fill(in_sight_.begin(), in_sight_.end(), 0);
    vehicles_.clear();
}

void track_evaluation::add(double utc, const std::vector<fmv::track>& tracks, bool ready,
                           const fmv::place_shift& corrected_by) {
    const auto motions = scene_.truth(utc);
    const geo::projection now{fmv::to_camera(scene_.reported(utc), scene::size, scene::plane())};
    std::vector<visible_vehicle> vehicles;
    for (std::size_t i = 0; i < motions.size(); ++i) {
        const auto at = in_picture(*true_view_, motions[i].at);
        const bool inside =
            ready && is_inside(in_picture(now, motions[i].at)) && is_inside(map_->to_grid(motions[i].at));
        in_sight_[i] = inside ? in_sight_[i] + 1 : 0;
        vehicles.push_back({.at = at, .has_to_be_found = in_sight_[i] > settled});
    }
    if (!ready) {
        return;
    }
    std::vector<geo::plane_position> places;
    std::vector<fmv::point> seen;
    for (const auto& t : tracks) {
        const auto place = scene::plane().to_plane({.lat = t.lat, .lon = t.lon});
        places.push_back(place);
        seen.push_back(in_picture(*reported_view_,
                                  {.east = place.east + corrected_by.east, .north = place.north + corrected_by.north}));
    }
    const auto matches = score_.add(vehicles, seen);
    for (std::size_t k = 0; k < tracks.size(); ++k) {
        if (matches[k]) {
            const auto& truth = motions[*matches[k]];
            vehicles_[tracks[k].id] = *matches[k];
            const auto squares = [](double x, double y) { return (x * x + y * y) / 2; };
            place_squares_ += squares(places[k].east - truth.at.east, places[k].north - truth.at.north);
            velocity_squares_ += squares(tracks[k].ve - truth.velocity.east, tracks[k].vn - truth.velocity.north);
            ++compared_;
        }
    }
}

std::optional<std::size_t> track_evaluation::vehicle_of(std::uint64_t track) const {
    const auto at = vehicles_.find(track);
    return at == vehicles_.end() ? std::nullopt : std::optional{at->second};
}

double track_evaluation::place_error() const noexcept {
    return compared_ == 0 ? 0 : std::sqrt(place_squares_ / static_cast<double>(compared_));
}

double track_evaluation::velocity_error() const noexcept {
    return compared_ == 0 ? 0 : std::sqrt(velocity_squares_ / static_cast<double>(compared_));
}

} // namespace jadc2
