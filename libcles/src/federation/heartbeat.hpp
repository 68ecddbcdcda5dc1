// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// What a bridge says of itself in each interval.
struct heartbeat {
    std::string node;
    std::chrono::milliseconds interval{400};
    std::string names{};    ///< a digest of the names of its pool's nodes
    std::string replaces{}; ///< the instance that it was before it connected again; empty: none
    bool leaving = false;
    bool starting = false;    ///< it knows nobody yet: others send theirs soon
    bool closing = false;     ///< it takes no more requests, and leaves when it has answered those that it has
    std::uint32_t roster = 0; ///< the version of its roster; 0: it has none
    bool sessions = false;    ///< what it sends to one bridge is sealed under a session, if that one has them, too

    bool operator==(const heartbeat&) const = default;
};

std::string text_of(const heartbeat& said);
/// Nothing: it is not a heartbeat.
std::optional<heartbeat> parse_heartbeat(std::string_view text);

/// The names of a pool's nodes, and the digest of these.
struct node_names {
    std::string digest;
    std::vector<std::string> nodes; ///< sorted

    bool operator==(const node_names&) const = default;
};
BOOST_DESCRIBE_STRUCT(node_names, (), (digest, nodes))

/// \param nodes in any order
node_names names_of(std::vector<std::string> nodes);
std::string text_of(const node_names& said);
/// Nothing: it is not a list of names.
std::optional<node_names> parse_names(std::string_view text, std::size_t most);

} // namespace cles::bridging
