// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "engaged_targets.hpp"
#include "engagement.hpp"
#include "magazine.hpp"
#include "order.hpp"
#include "own_sensor.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace strike {

/// Beyond these, an aircraft releases nothing.
struct release_limits {
    double oldest_s = 2;    ///< of a track
    double range_m = 5'000; ///< from the aircraft to the impact
    double flight_s = 10;   ///< of a weapon
    double widest_m = 15;   ///< standard deviation of the target's place, by the track alone, per axis
};

/// The most time that an order may be valid for, s.
constexpr double longest_order_s = 120;

enum class verdict : std::uint8_t {
    release,
    wrong,   ///< it is no order
    refused, ///< another aircraft may carry it out
    failed,  ///< no aircraft may
};

/// Whether a weapon may be released for an order, and where it is aimed.
struct decision {
    verdict kind = verdict::release;
    std::string why{}; ///< it may not
    aim at{};
    std::optional<target_filter> target{}; ///< now, if one may be released
};

/// What an aircraft knows when it decides.
struct aircraft {
    release_limits limits{};
    aircraft_state state{};
    magazine weapons;
    own_sensor sensor;
    engaged_targets engaged{};
    engaged_targets waiting{}; ///< the targets of orders that are held
    double no_track_before =
        0; ///< s since 1970: an order by an older track may have been carried out by an earlier run
};

/// Decides on an order, and changes nothing but what the sensor has seen. \param now s since 1970
decision decide(const order& what, double now, aircraft& own);

/// An order is held until a second member confirms it: its target is followed. \pre `decide` has just said release
void hold(const order& what, const decision& by, double now, aircraft& own);

/// An order that was held, with its target as the own sensor sees it now; nothing, if it does not.
std::optional<order> follow_up(const order& what, double now, aircraft& own);

/// A weapon is released. \pre `decide` has just said so
void release(const order& what, const decision& by, double now, aircraft& own);

/// A weapon was released by an earlier run of the aircraft, whose magazine knows that.
void remember(const order& what, double released_utc, aircraft& own);

} // namespace strike
