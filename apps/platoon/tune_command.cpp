// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulate_command.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <numeric>
#include <vector>

namespace platoon {
namespace {

constexpr double collision_cost = 10;
constexpr double error_weight = 0.05; // 1/m, of the largest error: without it, the first error would become large

double cost_of(scenario what, const gains& law, unsigned seeds) {
    what.setup.law = law;
    std::vector<double> costs;
    for (const auto first = what.seed; what.seed < first + seeds; ++what.seed) {
        const auto result = simulate(what);
        costs.push_back(result.string_ratio + (result.collision ? collision_cost : 0) +
                        error_weight * *std::max_element(result.error.begin(), result.error.end()));
    }
    std::sort(costs.begin(), costs.end(), std::greater<>{});
    const auto worst = static_cast<std::ptrdiff_t>(std::max<std::size_t>(1, costs.size() / 10));
    return std::accumulate(costs.begin(), costs.begin() + worst, 0.0) / static_cast<double>(worst);
}

void print_gains(const char* what, const gains& law, double cost) {
    std::printf("%-9s q1 %.4f, lambda %.4f, q3 %.4f, q4 %.5f, ahead_lead %.4f, leader_lead %.4f: cost %.4f\n", what,
                law.q1, law.lambda, law.q3, law.q4, law.ahead_lead, law.leader_lead, cost);
    std::fflush(stdout);
}

} // namespace

int tune_command(scenario what, unsigned seeds) {
    constexpr std::array searched{&gains::q1, &gains::lambda,     &gains::q3,
                                  &gains::q4, &gains::ahead_lead, &gains::leader_lead};
    auto best = what.setup.law;
    double least = cost_of(what, best, seeds);
    print_gains("start", best, least);
    for (const double step : {1.3, 1.12, 1.04}) {
        for (bool improved = true; improved;) {
            improved = false;
            for (const auto gain : searched) {
                for (const double factor : {step, 1 / step}) {
                    auto tried = best;
                    tried.*gain *= factor;
                    if (const double cost = cost_of(what, tried, seeds); cost < least - 1e-4) {
                        best = tried;
                        least = cost;
                        improved = true;
                        print_gains("better", best, least);
                    }
                }
            }
        }
    }
    print_gains("best", best, least);
    return 0;
}

} // namespace platoon
