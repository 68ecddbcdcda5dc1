// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "node/membership/announcement.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/reachable_endpoints.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles::core {

/// Writes the reply to `PULL self:cles/peers`.
void write_peers(json_writer& w, const membership& others, time_point now);

/// The adverbs of `PULL self:cles/peers since=... describe=...`.
struct table_question {
    std::string_view since;
    std::string_view describe{}; ///< epochs, separated by commas
};

/// Answers the gossip requests of other nodes (docs/protocol.md, "Gossip").
class peer_table_server {
  public:
    peer_table_server() = default;
    peer_table_server(const peer_table_server&) = delete;
    peer_table_server& operator=(const peer_table_server&) = delete;

    /// Writes what has changed, in at most `longest` bytes including the head of the reply.
    virtual void write_delta(json_writer& w, const table_question& asked, std::size_t longest, time_point now) = 0;
    /// Reads entries that were sent without a request. Returns false if `json` is not a table.
    virtual bool on_pushed_table(std::string_view json, const observed_source& by, time_point now) = 0;

  protected:
    ~peer_table_server() = default;
};

} // namespace cles::core

/// Reading and writing tables of nodes (docs/protocol.md, "Gossip").

namespace cles::core {

/// The maximum size of a reply on a stream, in bytes.
inline constexpr std::size_t table_page = 32 * 1024;
/// The maximum number of entries that count in a table sent without a request.
inline constexpr std::size_t max_pushed_entries = 64;

/// The node that replies.
struct table_owner {
    std::string_view node;
    std::string_view epoch; ///< as text
};
/// Writes the reply, in at most `longest` bytes including its head.
void write_delta(json_writer& w, const table_owner& who, const membership& others, const table_question& asked,
                 std::size_t longest, time_point now);

/// Writes the body of `PUSH self:cles/peers` with this node's own entry.
void write_own_entry(json_writer& w, const announcement& said, std::string_view epoch, std::uint64_t seq,
                     std::chrono::milliseconds age);

/// Receives the entries of a table.
class table_reader {
  public:
    table_reader() = default;
    table_reader(const table_reader&) = delete;
    table_reader& operator=(const table_reader&) = delete;
    virtual void on_report(const peer_report& report) = 0;
    virtual void on_heartbeat(const peer_heartbeat& beat) = 0;
    /// An entry that cannot be read was skipped.
    virtual void on_bad_entry() = 0;

  protected:
    ~table_reader() = default;
};

/// The members of a table other than its entries.
struct table_head {
    std::string node;  ///< of the node that replies; empty if missing
    std::string epoch; ///< as text
    std::string pool;  ///< of that node
    std::string next;  ///< empty: the node always sends its whole table
    bool more = false;
};

/// Reads a reply, or a table sent without a request. Returns false if it is not a table; the entries before the error
/// have already been passed to `to`.
bool read_table(std::string_view json, std::size_t max_entries, table_reader& to, table_head& head);

/// Reads the name, epoch, endpoints and pool from the reply to `PULL self:cles`. Returns false if the name or the epoch
/// is missing.
bool read_description(std::string_view json, peer_report& out);

} // namespace cles::core
