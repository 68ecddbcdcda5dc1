// SPDX-License-Identifier: BSL-1.0
#include "traffic.hpp"

#include "normal.hpp"

#include <cmath>
#include <numbers>

namespace geo {
namespace {

constexpr int roads = 10;
constexpr double apart = 10;         // m, from a road to the next
constexpr double angular_rate = 0.4; // rad/s, of the variation of the speed
constexpr double amplitude = 1.5;    // m, of the variation of the place: so 0.6 m/s, and 0.24 m/s² at most

} // namespace

traffic::traffic(std::uint64_t seed) {
    sgd::random_source chance{seed * 4 + 1};
    const double heading = chance.within_one() * std::numbers::pi;
    along_ = {.east = std::sin(heading), .north = std::cos(heading)};
    for (int road = 0; road < roads; ++road) {
        const double speed = between(chance, 12, 20) * (chance.below(2) == 0 ? -1 : 1);
        courses_.push_back({.start = between(chance, -half_road, half_road),
                            .speed = speed,
                            .phase = chance.within_one() * std::numbers::pi,
                            .aside = (road - (roads - 1) / 2.0) * apart + chance.within_one()});
        vehicles_.push_back({.half_length = between(chance, 1.75, 2.75),
                             .half_width = between(chance, 1.25, 2),
                             .contrast = between(chance, 30, 50) * (chance.below(2) == 0 ? -1 : 1)});
    }
}

std::vector<traffic::motion> traffic::at(double utc) const {
    std::vector<motion> all;
    for (const auto& each : courses_) {
        const double turn = angular_rate * utc + each.phase;
        const double travelled = each.start + each.speed * utc + amplitude * std::sin(turn) + half_road;
        const double whole = 2 * half_road;
        const double place = travelled - whole * std::floor(travelled / whole) - half_road;
        const double speed = each.speed + amplitude * angular_rate * std::cos(turn);
        all.push_back({.at = {.east = along_.east * place + along_.north * each.aside,
                              .north = along_.north * place - along_.east * each.aside},
                       .velocity = {.east = along_.east * speed, .north = along_.north * speed}});
    }
    return all;
}

} // namespace geo
