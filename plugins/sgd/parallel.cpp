// SPDX-License-Identifier: BSL-1.0
#include "parallel.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

namespace sgd {

std::vector<shard> divide(std::uint64_t points, const std::vector<double>& weights) {
    if (weights.size() > points) {
        throw std::invalid_argument(std::to_string(weights.size()) + " shards of " + std::to_string(points) +
                                    " points: each takes at least one");
    }
    const auto all = std::accumulate(weights.begin(), weights.end(), 0.0);
    std::vector<shard> out;
    std::uint64_t at = 0;
    double share = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        share += weights[i] / all;
        const auto left = weights.size() - i - 1; // each of which takes at least a point
        const auto wanted = static_cast<std::uint64_t>(std::llround(share * static_cast<double>(points)));
        const auto end = left == 0 ? points : std::clamp(wanted, at + 1, points - left);
        out.push_back({.first = at, .count = end - at});
        at = end;
    }
    return out;
}

std::vector<order> orders_for(const std::vector<shard>& shards, const order& like) {
    std::vector<order> out(shards.size(), like);
    for (std::size_t i = 0; i < shards.size(); ++i) {
        out[i].first = shards[i].first;
        out[i].count = shards[i].count;
        out[i].seed = like.seed.value_or(1) + i;
    }
    return out;
}

classifier average(const std::vector<trained>& parts) {
    double points = 0;
    classifier sum;
    for (const auto& part : parts) {
        const auto weight = static_cast<double>(part.points);
        points += weight;
        sum.weights[0] += weight * part.result.weights[0];
        sum.weights[1] += weight * part.result.weights[1];
        sum.bias += weight * part.result.bias;
    }
    return {.weights = {sum.weights[0] / points, sum.weights[1] / points}, .bias = sum.bias / points};
}

} // namespace sgd
