// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/driver.hpp"
#include "platoon/driver/state.hpp"

#include <boost/describe/class.hpp>

#include <map>
#include <string>

namespace platoon {

/// The body of PUSH `join`.
struct join_request {
    std::string name{};
    bool merges = false; ///< from the next lane, ahead of the present follower
};
BOOST_DESCRIBE_STRUCT(join_request, (), (name, merges))

/// The states of the vehicles that are received, by their names, with times of the receiver's clock.
using known_vehicles = std::map<std::string, state>;

/// The last vehicle of a platoon: the one that no other follows; of several, the rearmost; empty: there is none.
std::string last_vehicle(const known_vehicles& heard);

/// The setup of a vehicle that joins behind `ahead`, one of `heard`: at the end of the platoon from a distance, or, if
/// `merges`, from the next lane beside its place.
driver_setup setup_behind(const std::string& ahead, bool merges, const known_vehicles& heard, driver_setup own,
                          double now);

} // namespace platoon
