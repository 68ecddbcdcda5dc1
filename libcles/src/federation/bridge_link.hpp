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
                     ///< (in a secured fleet, those of one requester)
    };
    role what = role::to_pool;
    std::string pool{};
    std::uint32_t number = 0; ///< of links that the node opens, since it may need several to one pool
    /// In a secured fleet, the bridge from which requests come, or the member for which nouns are bound: each has a
    /// link of its own.
    std::string member{};

    auto operator<=>(const bridge_link&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
};

} // namespace cles::bridging
