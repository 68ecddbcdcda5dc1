// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/peer.hpp>

#include "node/base/backoff.hpp"

#include <cstdint>
#include <span>

namespace cles::core {

/// A node that can be given work.
struct candidate {
    node_load load;                    ///< as last reported
    std::uint32_t given = 0;           ///< this node's requests in progress there
    std::uint32_t given_at_report = 0; ///< of these, in progress when the load was reported
    time_point avoid_until{};          ///< it was busy or unreachable, and is not asked before

    /// The estimated work it has now.
    [[nodiscard]] std::uint64_t estimated_work() const noexcept {
        const auto known = std::uint64_t{load.queued} + load.running + given;
        return known > given_at_report ? known - given_at_report : 0;
    }
    /// Whether more work would probably start at once.
    [[nodiscard]] bool is_free() const noexcept {
        return load.workers == 0 ? !is_saturated() : estimated_work() < load.workers;
    }
    /// Whether all its workers are occupied and not likely to finish soon. If all are stuck, it reports no workers.
    [[nodiscard]] bool is_saturated() const noexcept {
        constexpr std::uint32_t long_us = 100'000;
        return load.running != 0 && load.running >= load.workers && load.service_us >= long_us;
    }
    /// Applies a reported load.
    void update_load(const node_load& now) noexcept {
        load = now;
        given_at_report = given;
    }
};

/// Whether one more piece of work is probably done sooner by `a` than by `b`.
[[nodiscard]] bool is_better(const candidate& a, const candidate& b) noexcept;

/// Selects the node for a piece of work: draws two at random and takes the better one. This keeps the longest queue
/// short although loads are outdated; if all took the best one, they would overload the same node (Mitzenmacher, The
/// Power of Two Choices in Randomized Load Balancing, 2001).
class power_of_two_choices {
  public:
    explicit power_of_two_choices(std::uint32_t seed) noexcept : draws_(seed) {}

    /// Null if there are none.
    [[nodiscard]] candidate* select(std::span<candidate* const> all) noexcept;

  private:
    jitter draws_;
};

} // namespace cles::core
