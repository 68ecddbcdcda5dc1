// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/limits.hpp>
#include <cles/multicast.hpp>
#include <cles/peer.hpp>

#include "port/group_port.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Reading and writing announcements, and the entries of gossip made from them (docs/protocol.md, "Membership").

namespace cles::core {

inline constexpr std::chrono::milliseconds min_interval{250};
inline constexpr std::chrono::milliseconds max_interval{60'000};
inline constexpr std::chrono::milliseconds usual_interval{1'000};
inline constexpr std::chrono::milliseconds interval_per_node{10}; ///< in a large network
inline constexpr std::size_t max_endpoints = 16;
inline constexpr std::size_t max_endpoint = 128;
inline constexpr std::size_t max_digest = 64;
inline constexpr std::size_t max_links = 16;
inline constexpr std::size_t max_links_bytes = 400;
inline constexpr std::size_t max_sources = multicast_options::most_interfaces;

/// The maximum time between two announcements of a node that knows this many others.
std::chrono::milliseconds interval_among(std::size_t others) noexcept;

/// An announcement as its node has signed it. Others pass it on unchanged.
struct signed_announcement {
    std::string body;
    std::string sig;

    bool operator==(const signed_announcement&) const = default;
};

struct announcement {
    std::string node;
    std::vector<std::string> endpoints{}; ///< as announced
    node_load load{};
    std::chrono::milliseconds interval = usual_interval; ///< until the next announcement, at most
    std::string tasks{};                                 ///< digest of its tasks
    bool leaving = false;
    std::string pool{}; ///< empty: the pool without a name
    /// The node's sources in the group, one per interface; empty if it uses one interface.
    std::vector<group_source> sources{};
    std::uint32_t roster = 0;                              ///< the version of its roster; 0: the node is not secured
    std::vector<std::string> signed_tasks{};               ///< tasks whose updates it signs
    std::vector<std::string> links{};                      ///< the only nodes it may have links to; empty: all
    std::shared_ptr<const signed_announcement> original{}; ///< null: it is not signed
};

/// Reads an update of the noun `<node>:cles`. On failure returns false, and `why` contains the reason.
bool read_announcement(const protocol::request_line& update, announcement& out, std::string& why);

/// Reads its body. Returns false if it is malformed.
bool read_announcement(std::string_view body, announcement& out);

/// Reads the value of one key; an unknown key is skipped.
bool read_announcement_member(json_reader& r, std::string_view key, announcement& out);

/// Appends the line with its LF, at most 1200 bytes: endpoints that do not fit are omitted, the last first.
void append_announcement(std::string& out, const announcement& said, std::uint64_t seq, std::string_view epoch);

/// Appends its body with at most so many endpoints.
void append_announcement_body(std::string& out, const announcement& said, std::size_t endpoints);
/// Appends the line of a signed announcement with its LF.
void append_announcement(std::string& out, std::string_view node, const signed_announcement& said, std::uint64_t seq,
                         std::string_view epoch);

/// The path of the noun under which secured nodes report their load.
inline constexpr std::string_view load_path = "cles/load";

// Members that several kinds of entries have.

/// Writes a list such as `links`, unless it is empty.
void write_list_member(json_writer& w, std::string_view name, const std::vector<std::string>& all);
void write_load_member(json_writer& w, const node_load& load);
void write_load(json_writer& w, const node_load& load);
bool read_load(json_reader& r, node_load& out);
/// Writes at most `most` of the endpoints.
void write_endpoints_member(json_writer& w, const std::vector<std::string>& endpoints, std::size_t most);
/// Nothing if it is malformed.
bool read_epoch(json_reader& r, std::optional<std::uint32_t>& out);
/// A number of milliseconds; `most` if it is more.
bool read_milliseconds(json_reader& r, std::chrono::milliseconds& out, std::chrono::milliseconds most);
/// A number; the largest if it is more.
bool read_count(json_reader& r, std::uint32_t& out);
bool read_interval(json_reader& r, std::chrono::milliseconds& out);

/// Digest for comparing lists of tasks: FNV-1a, 64 bits, in hex, of `tasks` in the reply to `PULL self:cles`.
std::string digest_of_tasks(std::string_view json);

/// A signed announcement, as it is passed on, and what belongs to it.
struct signed_entry {
    std::string_view body;
    std::uint64_t seq = 0;
    std::optional<std::uint32_t> epoch{};
    std::string sig{};
};
/// Reads the value of one key; an unknown key is skipped.
bool read_signed_member(json_reader& r, std::string_view key, signed_entry& out);
void write_signed_members(json_writer& w, const signed_announcement& said, std::uint64_t seq, std::string_view epoch);

/// An entry received by gossip: an announcement of a node, and the age of its last one.
struct peer_report {
    announcement announced;
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0; ///< 0: missing, as from nodes that only know plain tables
    std::chrono::milliseconds age{0};
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
