// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/joining.hpp"

#include <algorithm>

namespace platoon {
namespace {

constexpr double approach_distance = 40; // m behind the last vehicle at the start

/// The vehicle that follows this one; empty: none.
std::string follower_of(const std::string& ahead, const known_vehicles& heard) {
    const auto found =
        std::find_if(heard.begin(), heard.end(), [&ahead](const auto& each) { return each.second.ahead == ahead; });
    return found == heard.end() ? "" : found->first;
}

} // namespace

std::string last_vehicle(const known_vehicles& heard) {
    std::string last;
    for (const auto& [name, at] : heard) {
        if (follower_of(name, heard).empty() && (last.empty() || at.x < heard.at(last).x)) {
            last = name;
        }
    }
    return last;
}

driver_setup setup_behind(const std::string& ahead, bool merges, const known_vehicles& heard, driver_setup own,
                          double now) {
    const auto& at = heard.at(ahead);
    own.ahead = ahead;
    own.merges = merges;
    own.before = merges ? follower_of(ahead, heard) : "";
    const double distance = merges ? own.spacing : approach_distance;
    own.start = {at.x + at.v * (now - at.t) - distance, at.v, 0};
    return own;
}

} // namespace platoon
