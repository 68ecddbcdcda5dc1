// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/multicast.hpp>
#include <cles/peer.hpp>

#include "port/group_source.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// What a node says of itself to its multicast group, both directions (docs/protocol.md, "Membership").

namespace cles::core {

inline constexpr std::chrono::milliseconds shortest_interval{250};
inline constexpr std::chrono::milliseconds longest_interval{60'000};
inline constexpr std::size_t most_endpoints = 16;
inline constexpr std::size_t longest_endpoint = 128;
inline constexpr std::size_t longest_digest = 64;
inline constexpr std::size_t most_sources = multicast_options::most_interfaces;

struct announcement {
    std::string node;
    std::vector<std::string> endpoints{}; ///< as the node wrote them
    node_load load{};
    std::chrono::milliseconds interval{1'000}; ///< until the next one, at most
    std::string tasks{};                       ///< a digest of its tasks
    bool leaving = false;
    std::string pool{}; ///< empty: the one without a name
    /// Its sources in the group, one for each interface; empty if it takes part by one.
    std::vector<group_source> sources{};
};

/// Reads an update of the noun `<node>:cles`. On failure false, and `why` says what is wrong.
bool read_announcement(const protocol::request_line& update, announcement& out, std::string& why);

/// Reads the value of one of its keys; a key that it does not know is passed over.
bool read_announcement_member(json_reader& r, std::string_view key, announcement& out);

/// Appends the whole line and its LF, in 1200 bytes at most: endpoints that do not fit are left out, the last first.
void append_announcement(std::string& out, const announcement& said, std::uint64_t seq, std::string_view epoch);

/// The value of `load`.
void write_load(json_writer& w, const node_load& load);

/// Tells one list of tasks from another: FNV-1a, 64 bits, in hex, of the JSON that `PULL self:cles` has for it.
std::string digest_of_tasks(std::string_view json);

} // namespace cles::core
