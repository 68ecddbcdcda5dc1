// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace strike {

/// What is to be struck: a target, where it was at a time, and how it moves. Places are pixels of the ground as the
/// camera sees it, times are seconds since 1970.
struct order {
    std::string id{}; ///< no two orders have the same
    double x = 0;
    double y = 0;
    double vx = 0; ///< pixels per second
    double vy = 0;
    double utc = 0;
    std::uint64_t deadline_ms = 0; ///< as in the request: the waiting time is this minus the time left
    std::optional<bool> drill{};   ///< all but the release
};
BOOST_DESCRIBE_STRUCT(order, (), (id, x, y, vx, vy, utc, deadline_ms, drill))

/// What came of an order that was carried out.
struct outcome {
    std::string node{};
    std::string order{};
    double aim_x = 0; ///< where the target will be on impact
    double aim_y = 0;
    double impact_utc = 0;
    double flight_s = 0;
    std::uint64_t left = 0; ///< weapons
    double queue_ms = 0;    ///< from the order's arrival until it was looked at
    double run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(outcome, (), (node, order, aim_x, aim_y, impact_utc, flight_s, left, queue_ms, run_ms))

} // namespace strike
