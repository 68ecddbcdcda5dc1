// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace gateway {

/// A number in the reply of a node to `PULL NODE:cles/metrics`, and how it is told: a row of docs/metrics.md.
struct metric {
    std::string_view name;  ///< with the suffix that Prometheus demands of counters
    std::string_view kind;  ///< counter, gauge or summary
    std::string_view path;  ///< its member, as in "memory.used"
    std::string_view label; ///< of this number, as in verb="PULL"; may be empty
    std::string_view help;
    double scale = 1; ///< by which it is multiplied, so that times are in seconds

    [[nodiscard]] bool is_counter() const noexcept { return kind == "counter"; }
};
/// All that the nodes of this version count. Those of one name follow each other.
const std::vector<metric>& metric_table();

enum class metrics_format : std::uint8_t { prometheus, openmetrics };
/// The format that a client accepts, by its field `Accept`.
metrics_format metrics_format_for(std::string_view accept) noexcept;
std::string_view type_of(metrics_format format) noexcept;

/// The metrics of nodes as text. \param nodes their replies to `PULL NODE:cles/metrics`, by name; what cannot be read
/// is left out
std::string metrics_text(const std::map<std::string, std::string>& nodes, metrics_format format);

/// The results in the reply to a request for `all`: JSON by the name of the node. Empty if the reply has another form.
std::map<std::string, std::string> results_of_all(std::string_view reply);

} // namespace gateway
