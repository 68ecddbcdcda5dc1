// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "sgd/training.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace dsgd {

/// Divides points while they are trained on, among slots whose speeds only show then (weighted factoring: Hummel,
/// Schmidt, Uma and Wein, "Load-sharing in heterogeneous systems via weighted factoring", 1996). A slot trains one
/// shard at a time. Each shard takes a part of the time that is left if all work at their last speeds, so shards become
/// smaller, and all slots end at almost the same time. A shard that has begun is not taken back. The smaller it is, the
/// less the others wait if its slot becomes slower.
class splitter {
  public:
    /// The first shard of a slot is an even share, divided by this: the speeds are not known yet.
    static constexpr std::uint64_t first_divisor = 8;
    /// A later one takes the time that is left, divided by this.
    static constexpr double rest_divisor = 4;
    /// But it takes at least so long, because each costs a round trip. At the end, a quarter of it is enough.
    static constexpr double least_shard_ms = 20;

    /// \param slots        at least 1
    /// \param least_points that a shard has, unless fewer are left
    splitter(std::uint64_t points, std::size_t slots, std::uint64_t least_points = 1);

    /// What the slot trains from now on; empty if nothing is left.
    /// \param now_ms since the beginning of all
    sgd::shard next(std::size_t slot, double now_ms);
    /// The slot has trained its shard.
    void done(std::size_t slot, double now_ms);
    /// The slot will not train its shard: all slots divide it again. It begins anew, because its node is another.
    void lost(std::size_t slot);
    /// One more, which begins as the first ones did.
    void add_slot() { slots_.emplace_back(); }
    /// In points per millisecond; 0 if it is not known.
    [[nodiscard]] double speed(std::size_t slot) const noexcept { return slots_[slot].speed; }

  private:
    struct slot_state {
        double begun_ms = 0;
        double speed = 0; ///< of the last shard, in points per millisecond; 0 if there is none
        sgd::shard shard{};
    };

    [[nodiscard]] double wanted(const slot_state& slot) const;
    [[nodiscard]] double least(const slot_state& slot) const;

    std::uint64_t points_;
    double least_points_;
    std::uint64_t left_;
    std::vector<sgd::shard> open_; ///< ranges that no slot has or had
    std::vector<slot_state> slots_;
};

} // namespace dsgd
