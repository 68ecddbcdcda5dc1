// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles {

/// The load of a node.
struct node_load {
    std::uint32_t queued = 0;  ///< queued work
    std::uint32_t running = 0; ///< handlers that have not finished
    std::uint32_t workers = 0; ///< workers in its pool; 0: no pool
    /// Smoothed execution time of one job in microseconds; 0: not known.
    std::uint32_t service_us = 0;

    bool operator==(const node_load&) const = default;
};

enum class peer_state : std::uint8_t {
    live,
    suspect, ///< nothing received for 3.5 of its announcement intervals; forgotten after 15
    clash,   ///< a second live node with a name that is already used, possibly by this node: receives no requests
};

/// "live", "suspect", "clash"
std::string_view to_string(peer_state state) noexcept;

/// Another node, as announced by itself to the multicast group, or reported by others (docs/protocol.md, "Membership"
/// and "Gossip").
struct peer {
    std::string node;
    std::vector<std::string> endpoints; ///< URLs usable from here; requests are sent to the first
    std::string epoch;                  ///< identifies its current run
    std::chrono::milliseconds age{0};   ///< since it was last received
    peer_state state = peer_state::live;
    node_load load;
    std::string tasks; ///< a digest of its tasks, which changes when they do
    std::string via{}; ///< the neighbour through which requests reach it; empty: they are sent straight to it
    /// How many links away it is; 0: no route leads to it.
    unsigned hops = 1;
};

} // namespace cles
