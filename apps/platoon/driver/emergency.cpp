// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/emergency.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

constexpr double short_time = 2.5;     // s to a collision: the noise of a radar at 10 m never looks like that
constexpr double gentle_share = 0.3;   // of the maximum deceleration
constexpr double brake_reserve = 1.2;  // times the required deceleration
constexpr double reaction_time = 0.3;  // s, in which the acceleration of neither changes
constexpr double emergency_margin = 2; // m, that are left in the end
constexpr double least_room = 0.1;     // m
constexpr double least_braking = 0.1;  // m/s²: below this, the one ahead does not count as braking

} // namespace

double time_to_collision(const motion& self, const motion& rear) {
    const double gap = rear.x - self.x;
    if (gap <= 0) {
        return 0;
    }
    // The smallest positive solution of gap - closing t + parting t²/2 = 0.
    const double closing = self.v - rear.v;
    const double parting = rear.a - self.a;
    const double discriminant = closing * closing - 2 * parting * gap;
    if (discriminant < 0) {
        return INFINITY;
    }
    const double sum = closing + std::sqrt(discriminant);
    return sum > 0 ? 2 * gap / sum : INFINITY;
}

double required_deceleration(const motion& self, const motion& rear) {
    constexpr double t = reaction_time;
    const double own_speed = std::max(0.0, self.v + self.a * t);
    const double its_speed = std::max(0.0, rear.v + rear.a * t);
    const double gap = rear.x - self.x + (rear.v - self.v) * t + (rear.a - self.a) * t * t / 2;
    const double room = std::max(gap - emergency_margin, least_room);
    const double its_deceleration = std::max(0.0, -rear.a);
    const double closing = own_speed - its_speed;
    // Whether it stands before the two have the same speed.
    if (its_deceleration > least_braking && 2 * room * its_deceleration > its_speed * std::max(closing, 0.0)) {
        const double its_way = its_speed * its_speed / (2 * its_deceleration);
        return own_speed * own_speed / (2 * (room + its_way));
    }
    return closing > 0 ? its_deceleration + closing * closing / (2 * room) : 0;
}

std::optional<double> emergency_braking(const motion& self, const motion& rear, double brake) {
    if (rear.x <= self.x) {
        return brake;
    }
    const double required = required_deceleration(self, rear);
    if (time_to_collision(self, rear) >= short_time || required <= gentle_share * brake) {
        return std::nullopt;
    }
    return std::min(brake, brake_reserve * required);
}

} // namespace platoon
