// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>

namespace cles::bridging {

/// The numbers of the last requests of a bridge, which identify those that arrive twice.
class seen_numbers {
  public:
    static constexpr std::size_t window = 4096;

    /// Returns false if it was seen before, or is so old that it may have been.
    bool add(std::uint64_t number) noexcept;

  private:
    std::bitset<window> seen_; // by number modulo the window
    std::uint64_t highest_ = 0;
};

} // namespace cles::bridging
