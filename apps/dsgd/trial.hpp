// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "board.hpp"

namespace dsgd {

/// Of each shard, how fast it went: its part of all that its node did, by the time until that was there. So what waits
/// for a worker of the node counts, and the way there does. As weights for `sgd::divide` they let all end at the same
/// time.
std::vector<double> speeds(const std::vector<sgd::trained>& parts);

/// Measures how fast nodes are: even shards with a part of the work, and with more of it until that takes long enough.
class trial {
  public:
    /// No shard may take less, unless all of the work does. Within a CPU quota, a node runs for a part of each period,
    /// which is 100 ms unless somebody set it: what is shorter is measured at full speed, or not at all.
    static constexpr double least_ms = 100;
    /// The first attempt does this part of the work.
    static constexpr std::uint64_t first_part = 20;

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
    bool finished_ = false;
};

} // namespace dsgd
