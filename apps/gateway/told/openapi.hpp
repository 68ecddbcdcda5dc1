// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/schema.hpp>

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace gateway {

/// A task that a node offers, in its reply to `PULL NODE:cles`.
struct offered_task {
    std::string verb{};
    std::string task{};
    std::optional<std::string> description{};
    std::optional<std::vector<std::string>> parameters{}; ///< their names
};

/// A node, and what it tells about its tasks.
struct offering_node {
    std::string name{};
    std::string types{}; ///< the digest of what it tells about types; empty: nothing
    std::vector<offered_task> tasks{};
    std::map<std::pair<std::string, std::string>, cles::task_schemas> schemas{}; ///< by verb and task
};

/// The nodes that have replied to `PULL NODE:cles`, by name. Those whose description cannot be read are left out.
std::vector<offering_node> offering_nodes(const std::map<std::string, std::string>& replies);
/// Adds what the reply to `PULL NODE:cles/types/<task>` tells; what cannot be read is left out.
void add_schemas(offering_node& node, const std::string& task, std::string_view reply);

/// The document of OpenAPI 3.1 that describes what clients can request of these nodes.
std::string openapi_document(const std::vector<offering_node>& nodes);

} // namespace gateway
