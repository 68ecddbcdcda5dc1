// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/jitter.hpp"
#include "core/presence.hpp"

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Nodes that have gone without a word, and where they were: tried now and then, so that the halves of a network that
/// was cut in two find each other again.
class lost_nodes {
  public:
    static constexpr std::chrono::hours remembered{1};

    struct node {
        std::string name;
        std::string url;
        time_point until{};
    };

    lost_nodes(std::size_t most, std::uint32_t seed) noexcept : most_(most), jitter_(seed) {}

    void add(std::string_view name, std::string_view url, time_point now);
    /// One of them, or of those that are suspect, at random.
    std::optional<node> any(const presence& others, time_point now);

  private:
    std::size_t most_;
    jitter jitter_;
    std::vector<node> lost_;
};

} // namespace cles::core
