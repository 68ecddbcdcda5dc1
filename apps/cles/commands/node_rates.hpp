// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace tool {

/// How much a node does, from two of its answers to PULL self:cles/metrics.
struct node_rate {
    std::optional<double> requests{}; ///< a second, without those that asked for this; nothing after one answer
    std::optional<double> errors{};   ///< a second
    std::optional<double> p50_us{};   ///< what a handler takes, of all that ever ran
    std::optional<double> p99_us{};
};

/// Remembers the last answer of each node.
class node_rates {
  public:
    using time_point = std::chrono::steady_clock::time_point;

    /// \param run tells a node's runs apart, since each counts from 0
    /// \throws cles::error where it is not JSON
    node_rate take(const std::string& run, std::string_view metrics, time_point now);

    /// Forgets those that have not answered since.
    void forget_before(time_point when);

  private:
    struct counted {
        std::uint64_t requests = 0;
        std::uint64_t errors = 0;
        time_point when{};
    };
    std::map<std::string, counted> last_;
};

} // namespace tool
