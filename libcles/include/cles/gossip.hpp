// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/text_list.hpp>

namespace cles {

namespace detail {
struct gossip_part;
} // namespace detail

/// Whether a service takes part in gossip (docs/protocol.md, "Gossip"), and with which seeds. By default it does not.
struct gossip_options {
    /// URLs of nodes that are asked for other nodes, so that nodes find each other without multicast, and beyond its
    /// reach. Addresses are better than host names, which have to be resolved. A node that is a seed of others needs
    /// none.
    text_list seeds{};
    /// The names of the only nodes that this one may have links to, 16 at most; empty: all. Others that gossip respect
    /// it: they learn it from this node's announcements. A URL that is configured for a node is used all the same.
    /// Requests for nodes further away, and from them, pass through nodes that route (docs/protocol.md, "Routes").
    text_list links{};
    /// Set by `cles::gossip`. Seeds without it are refused with `invalid_option`.
    const detail::gossip_part* part = nullptr;
};

/// Returns options for `service_options::gossip` that enable gossip. Only programs that call this function link its
/// code.
gossip_options gossip(text_list seeds = {}, text_list links = {});

} // namespace cles
