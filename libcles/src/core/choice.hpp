// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/peer.hpp>

#include <cstdint>
#include <span>

namespace cles::core {

/// A node as one that might be given work.
struct candidate {
    node_load load;            ///< as it last said
    std::uint32_t given = 0;   ///< requests that this node has under way there
    std::uint32_t told_of = 0; ///< of these, as many were under way when it said so
    time_point avoid_until{};  ///< it was busy or out of reach, and is not asked again before

    /// Its work now, as far as it can be known here.
    [[nodiscard]] std::uint64_t ahead() const noexcept {
        const auto known = std::uint64_t{load.queued} + load.running + given;
        return known > told_of ? known - told_of : 0;
    }
    /// Whether more work would be begun at once, as far as it can be known here.
    [[nodiscard]] bool is_free() const noexcept { return load.workers == 0 ? !is_held() : ahead() < load.workers; }
    /// Whether all its workers are at work, and not likely to be done soon. Where all are stuck it has none.
    [[nodiscard]] bool is_held() const noexcept {
        constexpr std::uint32_t long_us = 100'000;
        return load.running != 0 && load.running >= load.workers && load.service_us >= long_us;
    }
    /// How much it has to do.
    void hears(const node_load& now) noexcept {
        load = now;
        told_of = given;
    }
};

/// Whether one more piece of work is probably done sooner by `a` than by `b`.
[[nodiscard]] bool is_better(const candidate& a, const candidate& b) noexcept;

/// Chooses who is to do a piece of work: draws two at random and takes the better. That keeps the longest queue short
/// though what is known of loads is old, where all who take the best one would fall upon the same (Mitzenmacher, The
/// Power of Two Choices in Randomized Load Balancing, 2001).
class choice {
  public:
    explicit choice(std::uint32_t seed) noexcept : state_(seed | 1U) {}

    /// One of them; null where there are none.
    [[nodiscard]] candidate* of(std::span<candidate* const> all) noexcept;

  private:
    std::uint32_t below(std::uint32_t bound) noexcept;

    std::uint32_t state_;
};

} // namespace cles::core
