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

/// A node that was found, as the commands list it.
struct listed_node {
    std::string node;
    std::string state;
    std::optional<std::int64_t> age_ms; ///< since its last announcement; nothing: it has just answered
    std::vector<std::string> endpoints;
    std::string epoch;
    std::optional<cles::node_load> load{}; ///< nothing: it has not reported any
    std::string tasks{};                   ///< what it offers, as JSON; empty if that is not known
    std::string error{};                   ///< why it is not known
    unsigned hops = 1;                     ///< links to it from the node that lists it; 0: there is no route
    std::string via{};                     ///< the neighbour that the route leads through
    std::string pool{};                    ///< empty: the unnamed pool, or not known

    /// The address at which to ask it, or empty.
    [[nodiscard]] std::string url() const { return endpoints.empty() ? std::string{} : endpoints.front(); }
    /// "3 links via car2", "none", or "-" for a link.
    [[nodiscard]] std::string route() const;
    /// "350 ms ago" or "now"
    [[nodiscard]] std::string last_seen() const;
    /// Sets its tasks from its answer to PULL self:cles.
    void read_tasks(std::string_view description);
    /// Whether these tasks include TASK, or VERB:TASK with the verb in any case.
    [[nodiscard]] bool offers(std::string_view task) const;
};

std::vector<listed_node> nodes_of(const std::vector<cles::peer>& peers);
/// From a node's answers to PULL self:cles and self:cles/peers, with addresses as they are of use here.
/// \param asked where the node was asked \throws cles::error with `conversion`
std::vector<listed_node> nodes_of(std::string_view asked, std::string_view self, std::string_view peers);
/// From its answer to PULL self:cles/peers alone. \throws cles::error with `conversion`
std::vector<listed_node> peers_in(std::string_view asked, std::string_view peers);

/// The address of each.
std::vector<std::string> urls_of(const std::vector<listed_node>& nodes);

/// {"queued":12,"running":3,"workers":4}
void write_load(cles::json_writer& w, const cles::node_load& load);

} // namespace tool
