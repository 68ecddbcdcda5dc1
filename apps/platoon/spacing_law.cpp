// SPDX-License-Identifier: BSL-1.0
#include "spacing_law.hpp"

#include <algorithm>

namespace platoon {

gains gains_for(double /*hz*/) { return {}; }

double wanted_distance(double spacing, double speed, double own_brake, double brake_ahead) {
    return spacing + std::max(0.0, speed * speed / 2 * (1 / own_brake - 1 / brake_ahead));
}

double spacing_law(const gains& law, const motion& self, const reference& ahead, const reference& leader,
                   double weight) {
    const auto error = [&](const reference& to) {
        return std::clamp(self.x - to.where.x + to.distance, -law.max_error, law.max_error);
    };
    const auto feed_forward = [](const reference& from, double part) {
        return from.where.a + part * from.lag_ratio * (from.command - from.where.a);
    };
    const double q3 = law.q3 * weight;
    const double q4 = law.q4 * weight;
    const double towards_ahead = (law.q1 + law.lambda) * (self.v - ahead.where.v) + law.q1 * law.lambda * error(ahead);
    const double towards_leader = (q4 + law.lambda * q3) * (self.v - leader.where.v) + law.lambda * q4 * error(leader);
    return (feed_forward(ahead, law.ahead_lead) + q3 * feed_forward(leader, law.leader_lead) - towards_ahead -
            towards_leader) /
           (1 + q3);
}

} // namespace platoon
