// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/spacing_law.hpp"

#include <algorithm>

namespace platoon {
namespace {

double error(const gains& law, const motion& self, const reference& to) {
    return std::clamp(self.x - to.where.x + to.distance, -law.max_error, law.max_error);
}

double feed_forward(const reference& from, double part) { return from.where.a + part * (from.command - from.where.a); }

} // namespace

gains gains_for(double /*hz*/) { return {}; }

double wanted_distance(double spacing, double speed, double own_brake, double brake_ahead) {
    return spacing + std::max(0.0, speed * speed / 2 * (1 / own_brake - 1 / brake_ahead));
}

double leader_part(const gains& law, const motion& self, const reference& leader) {
    return law.q3 * feed_forward(leader, law.leader_lead) + leader_part_via(law, self, leader, 0);
}

double leader_part_via(const gains& law, const motion& self, const reference& ahead, double part_of_ahead) {
    return part_of_ahead - (law.q4 + law.lambda * law.q3) * (self.v - ahead.where.v) -
           law.lambda * law.q4 * error(law, self, ahead);
}

double most_leader_part(const gains& law, double speed, double acceleration) {
    return law.q3 * acceleration + (law.q4 + law.lambda * law.q3) * speed + law.lambda * law.q4 * law.max_error;
}

double spacing_law(const gains& law, const motion& self, const reference& ahead, double from_leader, double weight) {
    const double towards_ahead =
        (law.q1 + law.lambda) * (self.v - ahead.where.v) + law.q1 * law.lambda * error(law, self, ahead);
    return (feed_forward(ahead, law.ahead_lead) - towards_ahead + weight * from_leader) / (1 + weight * law.q3);
}

} // namespace platoon
