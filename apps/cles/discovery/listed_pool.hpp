// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tool {

struct json_node;

/// Another pool, as a bridge knows it (docs/federation.md).
struct listed_pool {
    std::string bridge;  ///< the node that knows it
    std::string pool;    ///< empty: the bridge knows none
    std::string state;   ///< "live"; "lost": none of its bridges can be reached; "no NATS": the bridge is not connected
    std::string bridges; ///< of that pool; numbers as they were written
    std::string nodes;   ///< of that pool
};

/// From the answer of a node to PULL self:cles/metrics; empty if it is not a bridge.
std::vector<listed_pool> pools_in(std::string_view node, const json_node& metrics);

std::string pools_table(const std::vector<listed_pool>& pools);
/// {"pools":[{"bridge":"hub","pool":"north","state":"live","bridges":1,"nodes":3}]}
std::string pools_json(const std::vector<listed_pool>& pools);

} // namespace tool
