// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace platoon {

/// A vehicle changed what it does.
struct event {
    double t = 0;
    std::string vehicle{};
    std::string mode{};
    std::string why{};
};
BOOST_DESCRIBE_STRUCT(event, (), (t, vehicle, mode, why))

/// What a vehicle's own recorder holds at the end of its drive.
struct vehicle_report {
    std::string vehicle{};
    std::uint64_t sent = 0;
    std::uint64_t received = 0;       ///< of those it was bound to, before any was lost on purpose
    std::uint64_t lost = 0;           ///< on purpose
    std::uint64_t missed = 0;         ///< that did not come at all
    std::vector<double> latency_us{}; ///< from being sent until it was read here, before any delay on purpose
    std::vector<event> events{};
};
BOOST_DESCRIBE_STRUCT(vehicle_report, (), (vehicle, sent, received, lost, missed, latency_us, events))

} // namespace platoon
