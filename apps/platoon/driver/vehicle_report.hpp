// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace platoon {

/// A vehicle changed its mode.
struct event {
    double t = 0;
    std::string vehicle{};
    std::string mode{};
    std::string why{};
};
BOOST_DESCRIBE_STRUCT(event, (), (t, vehicle, mode, why))

/// What the recorder of a vehicle contains at the end of its drive.
struct vehicle_report {
    std::string vehicle{};
    std::uint64_t sent = 0;
    std::uint64_t received = 0;       ///< of vehicles it was bound to
    std::uint64_t missed = 0;         ///< of these, updates that its node reported as gaps
    std::vector<double> latency_us{}; ///< from sending to reading
    std::vector<event> events{};
};
BOOST_DESCRIBE_STRUCT(vehicle_report, (), (vehicle, sent, received, missed, latency_us, events))

} // namespace platoon
