// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "sgd/training.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace dsgd {

/// Divides points while they are trained on, among slots whose speeds only show then (weighted factoring: Hummel,
/// Schmidt, Uma and Wein, "Load-sharing in heterogeneous systems via weighted factoring", 1996). A slot trains one
/// shard at a time. Each shard takes half of the time that is left if all work at their last speeds, so shards become
/// smaller, and all slots end at almost the same time, even if speeds change.
class splitter {
  public:
    /// The first shard of a slot is this part of an even share: the speeds are not known yet.
    static constexpr std::uint64_t first_part = 8;
    /// Shards take at least so long, because each costs a round trip. Only those at the end may take a quarter of it.
    static constexpr double least_ms = 20;

    /// \param slots at least 1
    splitter(std::uint64_t points, std::size_t slots);

    /// What the slot trains next; empty if nothing is left.
    sgd::shard next(std::size_t slot);
    /// The slot has trained its shard. \param now_ms since the beginning of all
    void done(std::size_t slot, double now_ms);

  private:
    struct slot_state {
        double begun_ms = 0;
        double points = 0; ///< of its shard
        double speed = 0;  ///< of the last shard, in points per millisecond; 0 if there is none
    };

    [[nodiscard]] double wanted(const slot_state& slot) const;

    std::uint64_t points_;
    std::uint64_t next_ = 0;
    std::vector<slot_state> slots_;
};

} // namespace dsgd
