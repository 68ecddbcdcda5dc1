// SPDX-License-Identifier: BSL-1.0
#include "stream.hpp"

#include <cmath>
#include <numbers>

namespace fmv {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double gain = 0.1; ///< of the correction: the pointing drifts slowly, and shakes from frame to frame

// Fewer digits make a message shorter.
double hundredths(double value) { return std::round(value * 1e2) / 1e2; }
double to_a_centimetre(double degrees) { return std::round(degrees * 1e7) / 1e7; }

} // namespace

geo::camera to_camera(const camera_message& what, extent size, const geo::tangent_plane& plane) {
    return {.at = plane.to_plane({.lat = what.lat, .lon = what.lon}),
            .height = what.height,
            .azimuth = what.azimuth * degree,
            .depression = what.depression * degree,
            .focal_length = size.width / 2.0 / std::tan(what.field_of_view * degree / 2),
            .centre_x = size.width / 2.0,
            .centre_y = size.height / 2.0};
}

void stream::begin(const camera_message& first) {
    const geo::tangent_plane plane{{.lat = first.lat, .lon = first.lon}};
    const auto from = to_camera(first, size_, plane);
    map_.emplace(map{.plane = plane,
                     .grid = ground_grid{from, size_},
                     .deviation = geo::ground_deviation(from, first.position_sigma, first.pointing_sigma * degree)});
}

void stream::take(const grey& frame, const camera_message& from, double utc) {
    const bool first = !map_;
    if (first) {
        begin(from);
    }
    interval_ = utc - utc_.value_or(utc);
    utc_ = utc;
    auto picture = map_->grid.rectify(frame, to_camera(from, size_, map_->plane), correction_);
    if (!first) {
        const auto off = register_with(still_.reference(), picture, size_);
        align(picture, size_, off);
        correction_ = {.x = correction_.x + gain * off.dx, .y = correction_.y + gain * off.dy};
    }
    still_.complete(picture.pixels, picture.seen);
    if (!still_.known()) {
        still_.learn(picture.pixels);
        return;
    }
    tracker_.step(detector_.look(picture.pixels, still_.values()), interval_);
    still_.follow(picture.pixels, detector_.moving());
}

std::vector<track> stream::tracks() const {
    std::vector<track> out;
    for (const auto& t : tracker_.confirmed()) {
        const auto at = map_->plane.to_geographic(map_->grid.to_ground(t.at));
        const auto velocity = map_->grid.movement(t.velocity);
        out.push_back({.id = t.id,
                       .lat = to_a_centimetre(at.lat),
                       .lon = to_a_centimetre(at.lon),
                       .ve = hundredths(velocity.east),
                       .vn = hundredths(velocity.north),
                       .sigma = hundredths(map_->deviation),
                       .sigma_v = hundredths(tracker::velocity_deviation(interval_) * map_->grid.cell()),
                       .age = hundredths(t.age),
                       .missed = t.missed});
    }
    return out;
}

} // namespace fmv
