// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

namespace cles {

namespace detail {
struct gossip_part;
} // namespace detail

/// Whether a service takes part in gossip (docs/protocol.md, "Gossip"), and whom it asks first. Default constructed it
/// does not.
struct gossip_options {
    /// Where other nodes may be asked who is there, as URLs: how nodes find each other without multicast, and beyond
    /// its reach. Addresses are better than host names, whose lookup waits. A node that is the seed of others needs
    /// none.
    std::vector<std::string> seeds{};
    /// What `cles::gossip` sets. Seeds without it are refused with `invalid_option`.
    const detail::gossip_part* part = nullptr;
};

/// What makes a service take part in gossip, to be handed to `service_options::gossip`. A part of its own, so that a
/// program which does not name it does not carry it.
gossip_options gossip(std::vector<std::string> seeds = {});

} // namespace cles
