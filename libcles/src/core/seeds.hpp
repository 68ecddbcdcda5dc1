// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/jitter.hpp"
#include "core/presence.hpp"

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The addresses at which a node asks first, and again as long as nobody who answered there is live.
class seeds {
  public:
    static constexpr std::chrono::milliseconds first_pause{250};
    static constexpr std::chrono::milliseconds shortest_rest{2'000}; ///< the longest pause, in a small network

    explicit seeds(std::uint32_t chance) noexcept : jitter_(chance) {}

    /// Those that stay keep what is known of them. All others are due at once.
    void set(const std::vector<std::string>& urls);
    [[nodiscard]] bool empty() const noexcept { return all_.empty(); }
    /// One that is to be asked now; its next turn comes after a pause, of `rest` at most.
    std::optional<std::string> due(const presence& others, time_point now, std::chrono::milliseconds rest);
    /// When the next one is due, if nobody is found meanwhile.
    [[nodiscard]] std::optional<time_point> next() const noexcept;
    /// Who answers there.
    void on_answer(std::string_view url, std::string_view node);
    /// It is this node itself.
    void on_self(std::string_view url);

  private:
    struct seed {
        std::string url;
        std::string node{}; // that answered there
        bool self = false;
        std::chrono::milliseconds pause = first_pause;
        time_point next = time_point::min();
    };

    std::vector<seed> all_;
    jitter jitter_;
};

} // namespace cles::core
