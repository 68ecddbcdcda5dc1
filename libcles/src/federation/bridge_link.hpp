// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <compare>
#include <cstdint>
#include <string>

namespace cles::bridging {

/// A link between the node and its bridge.
struct bridge_link {
    enum class role : std::uint8_t {
        to_pool,     ///< opened by the node: its requests to the pool
        from_pool,   ///< opened by the bridge: the pool's requests; without a pool, those of programs that use NATS
        publications ///< opened by the bridge: the nouns that are published for other pools
    };
    role what = role::to_pool;
    std::string pool{};
    std::uint32_t number = 0; ///< of links that the node opens, since it may need several to one pool
    std::string member{};     ///< in a secured fleet, the bridge from which requests come: each has a link of its own

    auto operator<=>(const bridge_link&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
};

} // namespace cles::bridging
