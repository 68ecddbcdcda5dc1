// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "board.hpp"

namespace dsgd {

/// The speed of each part: the steps of all parts of its node, per millisecond until the last of them had arrived,
/// divided evenly among them. So the wait for a worker counts, and the round trip does. `sgd::divide` with these
/// weights makes shards that end at the same time.
std::vector<double> speeds(const std::vector<sgd::trained>& parts);

/// Measures how fast nodes are: even shards with a part of the work, and with more of it until that takes long enough.
/// An attempt in which a node is lost is repeated, because its time contains that of the lost node.
class trial {
  public:
    /// No shard may take less, unless `most_divisor` limits it. A node with a CPU quota runs for a part of each period,
    /// which is 100 ms unless somebody set it. However a shard lies, it gets at most one period's quota more or less
    /// than its share of the time. In three periods or more, that is an error of a third of the speed at most.
    static constexpr double least_trial_ms = 300;
    /// The first attempt does the work, divided by this.
    static constexpr std::uint64_t first_divisor = 20;
    /// No attempt does more than the work, divided by this (but at least one epoch), because its result is not used.
    static constexpr std::uint64_t most_divisor = 4;

    /// Nodes may be so many times as slow as others before their shards are given to another one.
    static constexpr double late_factor = 20;

    /// \param work    with `epochs`: what is to be done afterwards
    /// \param targets the nodes, in turn; at least one
    trial(std::uint64_t points, std::size_t shards, const sgd::order& work, std::vector<std::string> targets);

    [[nodiscard]] bool finished() const noexcept { return finished_; }
    /// What to train next, unless it is finished.
    [[nodiscard]] board attempt() const;
    /// \param all what `attempt` returned, done
    void take(const board& all);

    /// The node of each shard: another than planned, if that was lost.
    [[nodiscard]] const std::vector<std::string>& targets() const noexcept { return targets_; }
    [[nodiscard]] const std::vector<double>& weights() const noexcept { return weights_; }
    [[nodiscard]] std::uint64_t attempts() const noexcept { return attempts_; }
    /// What all attempts took.
    [[nodiscard]] double spent_ms() const noexcept { return spent_ms_; }
    /// The least time of a shard in the last attempt, by its node's clock.
    [[nodiscard]] double shortest_ms() const noexcept { return shortest_ms_; }

  private:
    std::uint64_t points_;
    std::uint64_t most_epochs_;
    sgd::order what_;
    std::vector<std::string> targets_;
    std::vector<double> weights_;
    double spent_ms_ = 0, shortest_ms_ = 0;
    std::uint64_t attempts_ = 0;
    bool finished_ = false;
};

} // namespace dsgd
