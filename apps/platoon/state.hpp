// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "motion.hpp"

#include <boost/describe/class.hpp>
#include <boost/describe/enum.hpp>

#include <cstdint>
#include <string>

namespace platoon {

/// What a vehicle is doing.
enum class role : std::uint8_t {
    lead,     ///< drives by itself
    follow,   ///< receives the leader and the one ahead
    degraded, ///< the leader is silent, or the platoon is broken ahead: it follows the one ahead alone
    fallback, ///< the one ahead is silent: it brakes to a halt
    leave     ///< drives on as before, and is about to leave the lane
};
BOOST_DESCRIBE_ENUM(role, lead, follow, degraded, fallback, leave)

/// What a vehicle tells all others, as `UPDATE name:state`. Nobody needs to know more: of whom is ahead, each learns
/// who leads, how far behind him it is to be, and who is next when the one ahead leaves.
struct state {
    role mode = role::follow;
    std::string ahead{}; ///< whom it follows; empty: nobody
    std::string lead{};  ///< who leads it; its own name where it leads
    double behind = 0;   ///< how far behind the leader it means to be, m, front to front
    double t = 0;        ///< s, by the sender's clock: only differences mean anything to others
    double x = 0, v = 0, a = 0;
    double u = 0, j = 0;      ///< the commanded acceleration from now on, m/s², and how it changes, m/s³
    std::int64_t sent_ns = 0; ///< CLOCK_MONOTONIC, for measuring on one machine; not used to drive

    [[nodiscard]] motion where() const noexcept { return {x, v, a}; }
};
BOOST_DESCRIBE_STRUCT(state, (), (mode, ahead, lead, behind, t, x, v, a, u, j, sent_ns))

} // namespace platoon
