// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/peer.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// A node as `cles ls` shows it.
struct listed_node {
    std::string node;
    std::string state;
    std::optional<std::int64_t> age_ms; ///< nothing: it has just answered itself
    std::vector<std::string> endpoints;
    std::string epoch;
    std::optional<cles::node_load> load{}; ///< nothing: it has not said
    std::string tasks{}; ///< what it offers, as JSON; empty where it has not been asked or has not answered
    std::string error{}; ///< why not

    /// Takes its tasks from its answer to PULL self:cles.
    void learn(std::string_view description);
    /// Whether these tasks hold TASK, or VERB:TASK with the verb in any case.
    [[nodiscard]] bool offers(std::string_view task) const;
};

std::vector<listed_node> listed(const std::vector<cles::peer>& peers);
/// From a node's answers to PULL self:cles and self:cles/peers. \throws cles::error with `conversion`
std::vector<listed_node> listed(std::string_view itself, std::string_view others);
/// From its answer to PULL self:cles/peers alone. \throws cles::error with `conversion`
std::vector<listed_node> listed_others(std::string_view others);

/// {"queued":12,"running":3,"workers":4}
void write_load(cles::json_writer& w, const cles::node_load& load);
/// "3/4 +12": of 4 workers 3 run, and 12 pieces of work wait. "3" where it has no workers, "-" where nothing is known.
std::string to_text(const std::optional<cles::node_load>& load);

/// For people; `tasks`: with what they offer.
std::string to_table(const std::vector<listed_node>& nodes, bool tasks);
/// As the reply to PULL self:cles/peers, and with `tasks` for each `tasks` as in PULL self:cles, or `failure`, why
/// there are none.
std::string to_json(const std::vector<listed_node>& nodes, bool tasks);

} // namespace tool
