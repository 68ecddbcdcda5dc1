// SPDX-License-Identifier: BSL-1.0
#include "parallel.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numeric>
#include <thread>

namespace sgd {

std::vector<shard> divide(std::uint64_t points, const std::vector<double>& weights) {
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

std::vector<double> speeds(const std::vector<trained>& parts) {
    std::vector<double> out;
    for (const auto& part : parts) {
        double count = 0;
        double steps = 0;
        double ms = 0;
        for (const auto& other : parts) {
            if (other.node == part.node) {
                ++count;
                steps += static_cast<double>(other.steps);
                ms = std::max(ms, other.after_ms.value_or(other.ms));
            }
        }
        out.push_back(steps / ms / count);
    }
    return out;
}

std::vector<std::string> nodes_of(const std::vector<trained>& parts) {
    std::vector<std::string> out;
    std::transform(parts.begin(), parts.end(), std::back_inserter(out), [](const trained& part) { return part.node; });
    return out;
}

times times_of(const std::vector<trained>& parts) {
    times out;
    for (const auto& part : parts) {
        out.elapsed_ms = std::max(out.elapsed_ms, part.after_ms.value_or(part.ms));
        out.longest_ms = std::max(out.longest_ms, part.ms);
    }
    out.overhead_ms = out.elapsed_ms - out.longest_ms;
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

std::vector<trained> train_here(const data_set& data, const std::vector<order>& orders) {
    using steady = std::chrono::steady_clock;
    using ms = std::chrono::duration<double, std::milli>;
    std::vector<trained> done(orders.size());
    const auto all_begun = steady::now();
    const auto train = [&](std::size_t i) {
        const auto begun = steady::now();
        const auto& what = orders[i];
        const schedule how{.steps = *what.epochs * what.count, .rate = *what.rate, .seed = *what.seed};
        training work{data, {.first = what.first, .count = what.count}, how};
        while (work.step()) {
        }
        const auto now = steady::now();
        done[i] = {.node = "here",
                   .result = work.result(),
                   .points = what.count,
                   .steps = how.steps,
                   .ms = ms{now - begun}.count(),
                   .after_ms = ms{now - all_begun}.count()};
    };
    std::vector<std::thread> threads;
    for (std::size_t i = 1; i < orders.size(); ++i) {
        threads.emplace_back(train, i);
    }
    train(0);
    for (auto& thread : threads) {
        thread.join();
    }
    return done;
}

} // namespace sgd
