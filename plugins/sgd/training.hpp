// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "classifier.hpp"
#include "data_set.hpp"
#include "random_source.hpp"

#include <cstddef>
#include <cstdint>

namespace sgd {

/// A stretch of the data set.
struct shard {
    std::uint64_t first = 0;
    std::uint64_t count = 0;

    bool operator==(const shard&) const = default;
};

/// How a shard is trained on.
struct schedule {
    std::uint64_t steps = 0; ///< T of the paper's Algorithm 1
    double rate = 1e-4;      ///< its eta
    std::uint64_t seed = 1;  ///< of the draws
};

/// Stochastic gradient descent for a linear classifier (paper, Algorithm 1), in one thread: each step draws a point of
/// the shard and moves the classifier against the gradient of (value - label)^2 / 2 there. It goes on in stretches, so
/// that it can report progress, and be cancelled. The same data, shard and schedule give the same bits
/// everywhere.
class training {
  public:
    /// \param data outlives it
    training(const data_set& data, shard part, const schedule& how, const classifier& start = {});

    /// Does another stretch; false where nothing is left.
    bool step();
    /// From 0 to 1.
    [[nodiscard]] double part_done() const noexcept;
    [[nodiscard]] const classifier& result() const noexcept { return now_; }

  private:
    // Takes some 0.1 ms.
    static constexpr std::uint64_t stretch = 1U << 14U;

    const data_set& data_;
    shard part_;
    schedule how_;
    random_source chance_;
    classifier now_;
    std::uint64_t done_ = 0;
};

} // namespace sgd
