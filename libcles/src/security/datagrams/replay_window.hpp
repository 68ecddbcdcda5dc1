// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace cles::security {

/// Which counters have been received: each counts once, none before the first one, and none that is 1024 or more below
/// the highest.
class replay_window {
  public:
    static constexpr std::uint64_t width = 1024;

    explicit replay_window(std::uint64_t first = 0) noexcept : first_(first) {}

    [[nodiscard]] bool accepts(std::uint64_t counter) const noexcept {
        if (counter < first_) {
            return false;
        }
        if (!any_ || counter > highest_) {
            return true;
        }
        return highest_ - counter < width && (word(counter) & bit(counter)) == 0;
    }

    /// \pre `accepts(counter)`
    void note(std::uint64_t counter) noexcept {
        if (!any_ || counter > highest_) {
            const auto fresh = any_ ? std::min<std::uint64_t>(counter / bits - highest_ / bits, words) : 0;
            for (std::uint64_t i = 0; i < fresh; ++i) {
                seen_[(counter / bits - i) % words] = 0;
            }
            highest_ = counter;
            any_ = true;
        }
        word(counter) |= bit(counter);
    }

    [[nodiscard]] std::uint64_t first() const noexcept { return first_; }
    /// The highest counter so far; 0 if there is none.
    [[nodiscard]] std::uint64_t highest() const noexcept { return highest_; }

  private:
    static constexpr std::uint64_t bits = 64;
    // A window that begins within a word reaches into one more.
    static constexpr std::uint64_t words = width / bits + 1;

    [[nodiscard]] static std::uint64_t bit(std::uint64_t counter) noexcept {
        return std::uint64_t{1} << counter % bits;
    }
    [[nodiscard]] std::uint64_t& word(std::uint64_t counter) noexcept { return seen_[counter / bits % words]; }
    [[nodiscard]] std::uint64_t word(std::uint64_t counter) const noexcept { return seen_[counter / bits % words]; }

    std::uint64_t first_;
    std::uint64_t highest_ = 0;
    bool any_ = false;
    std::array<std::uint64_t, words> seen_{};
};

} // namespace cles::security
