// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "discovery/listed_node.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/describe/class.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

class address_book;
class client;

/// How long it takes until the nodes of the network have answered the first query, with some reserve.
inline constexpr std::chrono::milliseconds discovery_time{350};

/// The nodes on the network. By multicast: those whose announcements were received by the time `until`. With --at: the
/// node there, and those that it knows. \throws cles::error if that one does not answer
boost::asio::awaitable<std::vector<listed_node>> find_nodes(client& requester, const address_book& addresses,
                                                            std::chrono::steady_clock::time_point until,
                                                            std::optional<std::chrono::milliseconds> timeout);

/// The same for interactive use: it ends at `until` at the latest, and by multicast as soon as one node was found,
/// which is then asked for the others. Empty if nothing answers in time.
boost::asio::awaitable<std::vector<listed_node>> find_nodes_quickly(client& requester, const address_book& addresses,
                                                                    std::chrono::steady_clock::time_point until);

/// The nodes whose announcements the command has received. A node whose key the command uses is not in conflict with
/// it.
std::vector<listed_node> heard_nodes(client& requester);

/// What the command's own node has counted in the group.
struct heard_datagrams {
    std::uint64_t datagrams_unsealed = 0;
    std::uint64_t group_unopened = 0;
    std::uint64_t announcements_foreign = 0;
    std::uint64_t group_dropped = 0;
};
BOOST_DESCRIBE_STRUCT(heard_datagrams, (), (datagrams_unsealed, group_unopened, announcements_foreign, group_dropped))

boost::asio::awaitable<heard_datagrams> count_heard(client& requester);

/// Whether nodes of other pools announce themselves where the command listens.
boost::asio::awaitable<bool> hears_other_pools(client& requester);

/// Whether the noun starts with `any:` or `all:` and no address is given: a node that routes has to be found.
bool needs_router(const address_book& addresses, std::string_view noun);

/// URLs of the nodes that may route, the most likely first. It waits for a likely one while nodes announce themselves
/// after the start. If there is no node, it is the default address.
boost::asio::awaitable<std::vector<std::string>> possible_routers(client& requester, const address_book& addresses);

/// The time until then; at least a millisecond, because a deadline of zero means the default.
std::chrono::milliseconds time_left(std::chrono::steady_clock::time_point until);

} // namespace tool
