// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "order.hpp"
#include "training.hpp"

#include <cstdint>
#include <string>
#include <vector>

/// Parallel stochastic gradient descent (paper, Algorithm 2): shards that are trained apart, and the mean of what comes
/// of them. Who trains them, threads of this process or nodes of a network, makes no difference to the result.
namespace sgd {

/// Divides the points into as many shards as there are weights, each as large as its weight says, and none empty: all
/// points, each once.
/// \param points  as many as there are weights, or more
/// \param weights more than 0 each
std::vector<shard> divide(std::uint64_t points, const std::vector<double>& weights);

/// An order for each shard, with draws of its own.
/// \param like what all have in common; its seed is that of the first
std::vector<order> orders_for(const std::vector<shard>& shards, const order& like);

/// Of each shard, how fast it went: its part of all that its node did, by the time until that was there. So what waits
/// for a worker of the node counts, and the way there does. As weights for `divide` they let all end at the same time.
std::vector<double> speeds(const std::vector<trained>& parts);

/// The nodes that trained them.
std::vector<std::string> nodes_of(const std::vector<trained>& parts);

/// Where the time went.
struct times {
    double elapsed_ms = 0;  ///< until the last part was there
    double longest_ms = 0;  ///< that a part took by its node's own clock
    double overhead_ms = 0; ///< the difference: what it costs that others do it
};
BOOST_DESCRIBE_STRUCT(times, (), (elapsed_ms, longest_ms, overhead_ms))

times times_of(const std::vector<trained>& parts);

/// The mean of the results, in which each counts by its points.
classifier average(const std::vector<trained>& parts);

/// Trains each shard in a thread of this process: what delegating is to be measured by.
/// \param orders with `epochs`, `rate` and `seed`, and with shards of this data
std::vector<trained> train_here(const data_set& data, const std::vector<order>& orders);

} // namespace sgd
