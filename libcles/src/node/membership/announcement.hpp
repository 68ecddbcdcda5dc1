// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/limits.hpp>
#include <cles/multicast.hpp>
#include <cles/peer.hpp>

#include "port/group_source.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Reading and writing announcements, and the entries of gossip made from them (docs/protocol.md, "Membership").

namespace cles::core {

inline constexpr std::chrono::milliseconds min_interval{250};
inline constexpr std::chrono::milliseconds max_interval{60'000};
inline constexpr std::size_t max_endpoints = 16;
inline constexpr std::size_t max_endpoint = 128;
inline constexpr std::size_t max_digest = 64;
inline constexpr std::size_t max_sources = multicast_options::most_interfaces;

struct announcement {
    std::string node;
    std::vector<std::string> endpoints{}; ///< as announced
    node_load load{};
    std::chrono::milliseconds interval{1'000}; ///< until the next announcement, at most
    std::string tasks{};                       ///< digest of its tasks
    bool leaving = false;
    std::string pool{}; ///< empty: the pool without a name
    /// The node's sources in the group, one per interface; empty if it uses one interface.
    std::vector<group_source> sources{};
};

/// Reads an update of the noun `<node>:cles`. On failure returns false, and `why` contains the reason.
bool read_announcement(const protocol::request_line& update, announcement& out, std::string& why);

/// Reads the value of one key; an unknown key is skipped.
bool read_announcement_member(json_reader& r, std::string_view key, announcement& out);

/// Appends the line with its LF, at most 1200 bytes: endpoints that do not fit are omitted, the last first.
void append_announcement(std::string& out, const announcement& said, std::uint64_t seq, std::string_view epoch);

/// Writes the value of `load`.
void write_load(json_writer& w, const node_load& load);

/// Digest for comparing lists of tasks: FNV-1a, 64 bits, in hex, of `tasks` in the reply to `PULL self:cles`.
std::string digest_of_tasks(std::string_view json);

/// A change of one incarnation to report. Views and pointers are valid until the table changes.
struct delta_entry {
    enum class kind : std::uint8_t {
        heartbeat,   ///< a new announcement; the rest is unchanged
        description, ///< the full entry
        leave,       ///< it has left; `announced` is null
    };
    kind what = kind::description;
    std::string_view node;
    const announcement* announced = nullptr;
    const std::vector<std::string>* endpoints = nullptr; ///< as relayed to others
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0;
    time_point last_seen{};
    peer_state state = peer_state::live;
    std::uint64_t revision = 0; ///< the order of changes
};

/// An entry received by gossip: the last announcement of a node, and its age.
struct peer_report {
    announcement announced;
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0; ///< 0: missing, as from nodes that only know plain tables
    std::chrono::milliseconds age{0};
    bool has_interval = false; ///< whether `announced.interval` was given
};

/// The same for a node of which nothing else has changed.
struct peer_heartbeat {
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0;
    std::chrono::milliseconds age{0};
    std::chrono::milliseconds interval{0};
    std::uint32_t queued = 0;
    std::uint32_t running = 0;
};

} // namespace cles::core
