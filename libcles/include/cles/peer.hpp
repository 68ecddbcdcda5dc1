// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles {

/// How much a node has to do.
struct node_load {
    std::uint32_t queued = 0;  ///< work that waits
    std::uint32_t running = 0; ///< handlers that have not ended
    std::uint32_t workers = 0; ///< what it has for it; 0: no pool of workers
    /// How long one piece of work takes, smoothed, in microseconds; 0: not known.
    std::uint32_t service_us = 0;

    bool operator==(const node_load&) const = default;
};

enum class peer_state : std::uint8_t {
    live,
    suspect, ///< not heard of for 3.5 of its intervals; after 15 it is forgotten
    clash,   ///< a second live node of a name that is taken, this node's own included: never asked
};

/// "live", "suspect", "clash"
std::string_view to_string(peer_state state) noexcept;

/// Another node, as it announced itself to the multicast group, or as others tell of it (docs/protocol.md, "Membership"
/// and "Gossip").
struct peer {
    std::string node;
    std::vector<std::string> endpoints; ///< URLs, as they can be used from here; the first is where it is asked
    std::string epoch;                  ///< of this run of it
    std::chrono::milliseconds age{0};   ///< since it was last heard
    peer_state state = peer_state::live;
    node_load load;
    std::string tasks; ///< a digest of what it offers, another one when that changes
};

} // namespace cles
