// SPDX-License-Identifier: BSL-1.0
#include "spacing_law.hpp"

#include <algorithm>

namespace platoon {

double spacing_law(const gains& by, const motion& self, const mark& ahead, const mark& leader, double weight) {
    const auto error = [&](const mark& to) {
        return std::clamp(self.x - to.where.x + to.distance, -by.most_error, by.most_error);
    };
    const auto fed = [](const mark& from, double part) { return from.where.a + part * (from.command - from.where.a); };
    const double q3 = by.q3 * weight;
    const double q4 = by.q4 * weight;
    const double towards_ahead = (by.q1 + by.lambda) * (self.v - ahead.where.v) + by.q1 * by.lambda * error(ahead);
    const double towards_leader = (q4 + by.lambda * q3) * (self.v - leader.where.v) + by.lambda * q4 * error(leader);
    return (fed(ahead, by.ahead_lead) + q3 * fed(leader, by.leader_lead) - towards_ahead - towards_leader) / (1 + q3);
}

} // namespace platoon
