// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace strike {

/// What is to be struck: a target, where it was at a time, and how it moves. Times are seconds since 1970.
struct order {
    std::string id{}; ///< no two orders have the same
    double lat = 0;   ///< degrees, WGS 84
    double lon = 0;
    double ve = 0;      ///< m/s, to the east
    double vn = 0;      ///< m/s, to the north
    double sigma = 0;   ///< m, standard deviation of the place, per axis
    double sigma_v = 0; ///< m/s, the same of the velocity
    double utc = 0;
    double until = 0;                     ///< no weapon is released at this time or later
    std::optional<bool> again{};          ///< even if the target has been attacked
    std::optional<bool> drill{};          ///< all but the release, even where its sensor sees no target
    std::optional<std::string> picture{}; ///< on which it is based, for the record
};
BOOST_DESCRIBE_STRUCT(order, (), (id, lat, lon, ve, vn, sigma, sigma_v, utc, until, again, drill, picture))

/// What came of an order that was carried out.
struct outcome {
    std::string node{};
    std::string order{};
    double aim_lat = 0; ///< where the target will be on impact
    double aim_lon = 0;
    double sigma = 0;        ///< m, standard deviation of that, per axis
    std::uint64_t plots = 0; ///< of the aircraft's own sensor, that were fused with the track
    double impact_utc = 0;
    double flight_s = 0;
    std::uint64_t left = 0; ///< weapons
    double run_ms = 0;
};
BOOST_DESCRIBE_STRUCT(outcome, (), (node, order, aim_lat, aim_lon, sigma, plots, impact_utc, flight_s, left, run_ms))

/// PUSH strike: what a person says of an order that is held.
struct word_on_order {
    std::string order{}; ///< its id
    std::string say{};   ///< `confirm`, which has to come from another member than the order; or `abort`
};
BOOST_DESCRIBE_STRUCT(word_on_order, (), (order, say))

} // namespace strike
