// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "motion.hpp"

#include <boost/describe/enum.hpp>

#include <cstdint>
#include <string>

namespace platoon {

/// The mode of a vehicle.
enum class role : std::uint8_t {
    lead,     ///< drives on its own; behind another vehicle, with a time gap by its radar
    follow,   ///< follows the leader and the one ahead
    degraded, ///< the leader is silent, or the platoon is broken ahead: it follows only the one ahead
    radar,    ///< the one ahead is silent: it follows what its radar sees, at a larger and larger distance
    fallback, ///< the one ahead is silent, and there is no radar: it brakes to a halt
    merge,    ///< in the next lane, beside the gap that opens for it
    leave     ///< drives on as before, and is about to leave the lane
};
BOOST_DESCRIBE_ENUM(role, lead, follow, degraded, radar, fallback, merge, leave)

/// What a vehicle tells of itself. From the one ahead, a vehicle gets the leader, its distance to the leader, and its
/// next predecessor when the one ahead leaves.
struct state {
    role mode = role::follow;
    std::string ahead{};  ///< the vehicle it follows; empty: none
    std::string lead{};   ///< its leader; its own name if it leads
    std::string admits{}; ///< the vehicle that joins between this one and its follower; empty: none
    double behind = 0;    ///< its desired distance to the leader, m, front to front
    double t = 0;         ///< s, by the sender's clock: only differences are meaningful to others
    double x = 0, v = 0, a = 0;
    double u = 0, j = 0;    ///< the commanded acceleration from now on, m/s², and how it changes, m/s³
    double from_leader = 0; ///< what the leader adds to it, m/s²; others may not receive the leader
    double lag = vehicle_limits{}.lag, brake = vehicle_limits{}.brake; ///< its own, s and m/s²
    std::int64_t sent_ns = 0; ///< CLOCK_MONOTONIC, for measuring on one machine; not used to drive

    [[nodiscard]] motion position() const noexcept { return {x, v, a}; }
};

} // namespace platoon
