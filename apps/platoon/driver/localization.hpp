// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/tangent_plane.hpp"
#include "platoon/driver/state.hpp"

#include <boost/describe/class.hpp>
#include <boost/describe/enum.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace platoon {

/// What the paper names as the least that a platoon needs, which a vehicle publishes as `UPDATE name:localization`.
struct localization {
    double utc = 0;          ///< s since 1970, by the sender's clock
    double lat = 0, lon = 0; ///< degrees, of its front
    double velocity = 0;     ///< m/s
    double acceleration = 0; ///< m/s²
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon, velocity, acceleration))

/// The update that a vehicle publishes as `UPDATE name:state`: its localization, and what others need to know of its
/// role and its next accelerations. Only the localization is needed. Older vehicles write `v` and `a` for velocity and
/// acceleration, and read nothing without all but `velocity`, `acceleration`, `from_leader` and `length`.
struct state_message {
    std::optional<role> mode{}; ///< absent: it drives on its own
    /// Absent: it does not tell. If `lead` or `behind` is absent, so are both.
    std::optional<std::string> ahead{}, lead{}, admits{};
    std::optional<double> behind{};
    double utc = 0, lat = 0, lon = 0;
    std::optional<double> velocity{}, acceleration{};
    std::optional<double> v{}, a{};      ///< the same
    std::optional<double> u{}, j{};      ///< m/s², m/s³; absent: it keeps its acceleration
    std::optional<double> from_leader{}; ///< m/s²
    std::optional<double> lag{}, brake{}, length{};
    std::optional<std::int64_t> sent_ns{};
};
BOOST_DESCRIBE_STRUCT(state_message, (),
                      (mode, ahead, lead, admits, behind, utc, lat, lon, velocity, acceleration, v, a, u, j,
                       from_leader, lag, brake, length, sent_ns))

/// What a vehicle tells of itself.
enum class dialect : std::uint8_t {
    current, ///< everything
    older,   ///< neither its length, nor its speed and acceleration under their present names
    minimum  ///< its localization alone, as vehicles of another make may
};
BOOST_DESCRIBE_ENUM(dialect, current, older, minimum)
/// What is left of a message.
state_message reduced(state_message of, dialect how);

/// The road: a straight line on the plane, which all vehicles know as their map.
geo::geographic place_on_road(double x);
double distance_on_road(const geo::geographic& place);

/// \param start_utc UTC at the local time 0 of the sender
state_message to_message(const state& of, double start_utc);
localization localization_of(const state_message& of);
/// \param start_utc UTC at the local time 0 of the receiver, to which `t` then refers
state to_state(const state_message& heard, double start_utc);

} // namespace platoon
