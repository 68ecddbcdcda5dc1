// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "discovery/listed_node.hpp"

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <optional>
#include <vector>

namespace tool {

class address_book;
class client;

/// The nodes that are there. By multicast: those that were heard by the time `listen_until`. With --at: the node there,
/// and whom it knows. \throws cles::error where that one does not answer
boost::asio::awaitable<std::vector<listed_node>> find_nodes(client& asker, const address_book& addresses,
                                                            std::chrono::steady_clock::time_point listen_until,
                                                            std::optional<std::chrono::milliseconds> timeout);

/// As above, but for who cannot wait: not later than `until`, and by multicast as soon as one node has been heard,
/// which is then asked for the others. Nobody where nobody answers in time.
boost::asio::awaitable<std::vector<listed_node>> find_nodes_soon(client& asker, const address_book& addresses,
                                                                 std::chrono::steady_clock::time_point until);

} // namespace tool
