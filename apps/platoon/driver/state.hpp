// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"
#include "platoon/driver/spacing_law.hpp"

#include <boost/describe/enum.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace platoon {

/// The mode of a vehicle.
enum class role : std::uint8_t {
    lead,     ///< drives on its own; behind another vehicle, with a time gap by its radar
    follow,   ///< follows the leader and the one ahead
    degraded, ///< the leader is silent, or the platoon is broken ahead: it follows the one ahead, and heeds the leader
              ///< only as far as that reports it
    radar,    ///< the one ahead is silent, or too few of its updates arrive: it follows what its radar sees, at a
              ///< larger and larger distance
    fallback, ///< the one ahead is silent, and there is no radar: it brakes to a halt
    merge,    ///< in the next lane, beside the gap that opens for it
    leave     ///< drives on as before, and is about to leave the lane
};
BOOST_DESCRIBE_ENUM(role, lead, follow, degraded, radar, fallback, merge, leave)

/// What a vehicle tells of itself. From the one ahead, a vehicle gets the leader, its distance to the leader, and its
/// next predecessor when the one ahead leaves.
struct state {
    role mode = role::follow;
    std::string ahead{};    ///< the vehicle it follows; empty: none
    std::string lead{};     ///< its leader; its own name if it leads
    bool tells_lead = true; ///< false: it says neither who leads it nor how far ahead that is
    std::string admits{};   ///< the vehicle that joins between this one and its follower; empty: none
    double behind = 0;      ///< its desired distance to the leader, m, front to front
    double t = 0;           ///< s, by the sender's clock: only differences are meaningful to others
    double x = 0, v = 0, a = 0;
    /// The commanded acceleration from now on, as far as its actuators can, m/s², and how it changes, m/s³.
    double u = 0, j = 0;
    /// The leader's term in the numerator of the control law, m/s², without its weight: others may not receive the
    /// leader. Empty if it has none.
    std::optional<double> from_leader{};
    double lag = vehicle_limits{}.lag, brake = vehicle_limits{}.brake; ///< s, with which `a` follows `u`, and m/s²
    double length = vehicle_limits{}.length;                           ///< m
    std::int64_t sent_ns = 0; ///< CLOCK_MONOTONIC, for measuring on one machine; not used to drive

    [[nodiscard]] motion position() const noexcept { return {x, v, a}; }
};

/// No vehicle on a road exceeds these, m/s and m/s².
inline constexpr double most_speed = 100, most_acceleration = 20;

/// The motion at `t` of a vehicle that has had no driver since this state: it keeps braking, and starts to brake if it
/// did not.
motion without_driver(const state& last, double t);

/// Why no vehicle can be in this state, so that its update has to be dropped; empty: it can. It may come from anybody.
std::string implausible(const state& told, const gains& law);

} // namespace platoon
