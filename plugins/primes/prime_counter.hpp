// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace primes {

/// Counts the primes from one number up to another, stretch by stretch (the sieve of Eratosthenes, in segments), so
/// that it can report progress, and be cancelled.
class prime_counter {
  public:
    /// From `from` on, and below `below`.
    prime_counter(std::uint64_t from, std::uint64_t below);

    /// Counts another stretch; false where nothing is left.
    bool step();
    /// From 0 to 1.
    [[nodiscard]] double part_done() const noexcept;
    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
    /// 0 where there is none.
    [[nodiscard]] std::uint64_t largest() const noexcept { return largest_; }

  private:
    // Fits into the innermost cache; takes some 0.1 ms.
    static constexpr std::size_t stretch = 1U << 16U;

    std::uint64_t from_;
    std::uint64_t below_;
    std::uint64_t at_;
    std::vector<std::uint64_t> divisors_; ///< the primes up to the square root of the end
    std::vector<bool> composite_;
    std::uint64_t count_ = 0;
    std::uint64_t largest_ = 0;
};

bool is_prime(std::uint64_t number) noexcept;

} // namespace primes
