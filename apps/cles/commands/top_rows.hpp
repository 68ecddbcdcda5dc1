// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "discovery/listed_node.hpp"
#include "output/json_node.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// What a node has counted, from its last two answers to PULL self:cles/metrics.
struct node_rate {
    std::optional<double> requests{}; ///< per second, without those of this command; nothing after one answer
    std::optional<double> errors{};   ///< per second
    std::optional<double> p50_us{};   ///< run time of handlers, since the start of the node
    std::optional<double> p99_us{};
    std::optional<std::uint64_t> moved_out{}; ///< jobs that other nodes ran, since the start of the node
    std::optional<std::uint64_t> moved_in{};  ///< jobs of other nodes that it ran
};

/// How long the handlers of a task have taken, since the start of the node.
struct task_time {
    std::string task;
    std::string verb;
    std::uint64_t samples = 0;
    double p50_us = 0;
    double p99_us = 0;
};

/// From the reply to `PULL self:cles/metrics`; empty if the node does not tell.
std::vector<task_time> task_times_in(const json_node& metrics);

/// Keeps the last answer of each node.
class node_rates {
  public:
    using time_point = std::chrono::steady_clock::time_point;

    /// \param run identifies a run of a node, because each run counts from 0
    /// \param document the reply to `PULL self:cles/metrics`
    node_rate update(const std::string& run, const json_node& document, time_point now);

    /// Removes nodes that have not answered since.
    void remove_before(time_point when);

  private:
    struct counters {
        std::uint64_t requests = 0;
        std::uint64_t errors = 0;
        time_point when{};
    };
    std::map<std::string, counters> last_;
};

/// A node as `cles top` shows it; of another pool, with the pool's name before its own: "north.car1".
struct top_row {
    listed_node node; ///< `error`: why its metrics are not known
    node_rate rate{};
    std::vector<task_time> tasks{};
};

enum class top_order : std::uint8_t { load, name };

/// By load: the highest number of jobs per worker first.
void sort_rows(std::vector<top_row>& rows, top_order order);

/// A summary in one line.
std::string summary_of(const std::vector<top_row>& rows);
std::string to_table(const std::vector<top_row>& rows);
/// The tasks of all nodes, the slowest first.
std::string tasks_to_table(const std::vector<top_row>& rows);
std::string to_json(const std::vector<top_row>& rows);

} // namespace tool
