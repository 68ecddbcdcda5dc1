// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "order.hpp"
#include "training.hpp"

#include <cstdint>
#include <vector>

/// Parallel stochastic gradient descent (paper, Algorithm 2): shards that are trained apart, and the mean of what comes
/// of them. Who trains them, threads of this process or nodes of a network, makes no difference to the result.
namespace sgd {

/// Divides the points into as many shards as there are weights, each as large as its weight says, and none empty: all
/// points, each once.
/// \param weights more than 0 each
/// \throws std::invalid_argument if there are more weights than points
std::vector<shard> divide(std::uint64_t points, const std::vector<double>& weights);

/// An order for each shard, with draws of its own.
/// \param like what all have in common; its seed is that of the first
std::vector<order> orders_for(const std::vector<shard>& shards, const order& like);

/// The mean of the results, in which each counts by its points.
classifier average(const std::vector<trained>& parts);

} // namespace sgd
