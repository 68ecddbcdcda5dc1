// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/state.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace platoon {
namespace {

constexpr double fastest_change = 1000; // m/s³, of the command
constexpr double longest_lag = 5;       // s
constexpr double longest_vehicle = 100; // m
constexpr double farthest = 1e7;        // m
constexpr double latest = 1e11;         // s
constexpr double fail_safe = -3;        // m/s²

} // namespace

motion without_driver(const state& last, double t) {
    return advance(last.position(), std::min(last.u, fail_safe), last.lag, t - last.t);
}

std::string implausible(const state& told, const gains& law) {
    struct limited {
        const char* name;
        double value, most;
    };
    // Written so that NaN is outside too.
    for (const auto& [name, value, most] :
         {limited{"behind", told.behind, farthest}, limited{"time", told.t, latest}, limited{"place", told.x, farthest},
          limited{"velocity", told.v, most_speed}, limited{"acceleration", told.a, most_acceleration},
          limited{"u", told.u, most_acceleration}, limited{"j", told.j, fastest_change},
          limited{"lag", told.lag, longest_lag}, limited{"brake", told.brake, most_acceleration},
          limited{"length", told.length, longest_vehicle},
          limited{"from_leader", told.from_leader.value_or(0), most_leader_part(law, most_speed, most_acceleration)}}) {
        if (!(std::abs(value) <= most)) {
            return std::string{name} + " is not a number within " + std::to_string(most);
        }
    }
    for (const auto& [name, value] : {std::pair{"lag", told.lag}, {"brake", told.brake}, {"length", told.length}}) {
        if (value <= 0) {
            return std::string{name} + " is not positive";
        }
    }
    return "";
}

} // namespace platoon
