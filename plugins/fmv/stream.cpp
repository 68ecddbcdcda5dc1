// SPDX-License-Identifier: BSL-1.0
#include "stream.hpp"

#include "track_digits.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace fmv {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double gain = 0.1; ///< of the correction: the pointing drifts slowly, and shakes from frame to frame
constexpr double period_gain = 0.1;
constexpr int most_unaligned = 50; ///< two seconds of usual video

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
    ++maps_;
    correction_ = {};
    unaligned_ = 0;
    still_ = background{size_};
    tracker_.forget();
}

std::optional<rectified> stream::aligned(const grey& frame, const camera_message& from) {
    auto picture = map_->grid.rectify(frame, to_camera(from, size_, map_->plane), correction_);
    const auto off = register_with(still_.reference(), picture, size_);
    if (!off) {
        return std::nullopt;
    }
    align(picture, size_, *off);
    correction_ = {.x = correction_.x + gain * off->dx, .y = correction_.y + gain * off->dy};
    return picture;
}

void stream::watch(rectified picture) {
    still_.complete(picture.pixels, picture.seen);
    if (!still_.known()) {
        still_.learn(picture.pixels);
        return;
    }
    tracker_.step(detector_.look(picture.pixels, still_.values()), interval_);
    still_.follow(picture.pixels, detector_.moving());
}

void stream::take(const grey& frame, const camera_message& from, double utc) {
    interval_ = utc - utc_.value_or(utc);
    // A pause is no lower rate: velocities after it are as inaccurate as before.
    const double usual = period_ == 0 ? interval_ : std::min(interval_, (still_.known() ? 2 : 1) * period_);
    period_ = period_ == 0 ? usual : period_ + period_gain * (usual - period_);
    utc_ = utc;
    if (map_) {
        if (auto picture = aligned(frame, from)) {
            unaligned_ = 0;
            watch(std::move(*picture));
            return;
        }
        if (still_.known() && ++unaligned_ <= most_unaligned) {
            tracker_.step({}, interval_);
            return;
        }
    }
    begin(from);
    watch(map_->grid.rectify(frame, to_camera(from, size_, map_->plane), correction_));
}

std::optional<stream::place_error> stream::error_of_places() const {
    if (!map_) {
        return std::nullopt;
    }
    return place_error{.map = maps_, .common = map_->deviation, .own = tracker::place_deviation * map_->grid.cell()};
}

std::vector<track> stream::tracks() const {
    std::vector<track> out;
    const auto accuracy = error_of_places().value_or(place_error{});
    for (const auto& t : tracker_.confirmed()) {
        const auto at = map_->plane.to_geographic(map_->grid.to_ground(t.at));
        const auto velocity = map_->grid.movement(t.velocity);
        out.push_back({.id = t.id,
                       .lat = to_a_centimetre(at.lat),
                       .lon = to_a_centimetre(at.lon),
                       .ve = hundredths(velocity.east),
                       .vn = hundredths(velocity.north),
                       .sigma = stated_deviation(std::hypot(accuracy.common, accuracy.own)),
                       .sigma_v = stated_deviation(tracker::velocity_deviation(period_) * map_->grid.cell()),
                       .age = hundredths(t.age),
                       .missed = t.missed});
    }
    return out;
}

} // namespace fmv
