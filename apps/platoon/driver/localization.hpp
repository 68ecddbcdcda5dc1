// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/tangent_plane.hpp"
#include "platoon/driver/state.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace platoon {

/// The update that a vehicle publishes as `UPDATE name:state`: UTC, latitude, longitude, velocity and acceleration, and
/// what others need to know of its role and its next accelerations.
struct localization {
    role mode = role::follow;
    std::string ahead{}, lead{}, admits{};
    double behind = 0;
    double utc = 0;                      ///< s since 1970, by the sender's clock
    double lat = 0, lon = 0;             ///< degrees, of its front
    double v = 0, a = 0;                 ///< m/s, m/s²
    double u = 0, j = 0;                 ///< m/s², m/s³
    std::optional<double> from_leader{}; ///< m/s²
    double lag = 0, brake = 0;
    std::int64_t sent_ns = 0;
};
BOOST_DESCRIBE_STRUCT(localization, (),
                      (mode, ahead, lead, admits, behind, utc, lat, lon, v, a, u, j, from_leader, lag, brake, sent_ns))

/// The road: a straight line on the plane, which all vehicles know as their map.
geo::geographic place_on_road(double x);
double distance_on_road(const geo::geographic& place);

/// \param start_utc UTC at the local time 0 of the sender
localization to_localization(const state& of, double start_utc);
/// \param start_utc UTC at the local time 0 of the receiver, to which `t` then refers
state to_state(const localization& heard, double start_utc);

} // namespace platoon
