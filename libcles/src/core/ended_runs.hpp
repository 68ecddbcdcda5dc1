// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>

namespace cles::core {

/// Runs of nodes that are over, so that what they said before does not bring them back. Bounded; each is forgotten
/// when nobody believes its last words any more.
class ended_runs {
  public:
    struct run {
        std::string node;
        std::uint64_t seq = 0; ///< of its last word
        time_point at{};       ///< of its end
        time_point until{};    ///< remembered so long
        bool farewell = false; ///< it said so itself
        std::uint64_t news = 0;
    };

    explicit ended_runs(std::size_t most) noexcept : most_(most) {}

    void add(std::uint32_t epoch, run ended, time_point now);
    /// It lives after all.
    void forget(std::uint32_t epoch) { runs_.erase(epoch); }
    /// Whether that was said before its end, or for want of numbers may have been.
    [[nodiscard]] bool covers(std::string_view node, std::uint32_t epoch, std::uint64_t seq) const noexcept;
    /// The same of a run whose node is not named.
    [[nodiscard]] bool covers(std::uint32_t epoch, std::uint64_t seq) const noexcept;
    [[nodiscard]] const std::unordered_map<std::uint32_t, run>& all() const noexcept { return runs_; }

  private:
    std::size_t most_;
    std::unordered_map<std::uint32_t, run> runs_; // by epoch
};

} // namespace cles::core
