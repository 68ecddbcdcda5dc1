// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "node/membership/announcement.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/route_table.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Reading and writing tables of nodes (docs/protocol.md, "Gossip").

namespace cles::core {

/// Writes the reply to `PULL self:cles/peers`.
void write_peers(json_writer& w, const std::vector<peer>& all, std::string_view pool);

/// The maximum size of a reply on a stream, in bytes.
inline constexpr std::size_t table_page = 32 * 1024;
/// The maximum number of entries that count in a table sent without a request.
inline constexpr std::size_t max_pushed_entries = 64;

/// The adverbs of `PULL self:cles/peers since=... describe=... routes=...`, and who asks.
struct table_question {
    std::string_view since;
    std::string_view describe{}; ///< epochs, separated by commas
    protocol::routes_question routes{};
    std::string_view zone{}; ///< of the link to the node that asks, if that is at a link-local IPv6 address
};

/// The node that replies.
struct table_owner {
    std::string_view node;
    std::string_view epoch; ///< as text
};
/// What is advertised for an entry, if anything.
using route_function = std::function<std::optional<route_advert>(const delta_entry&)>;

/// Writes what has changed, in at most `longest` bytes including the head of the reply. `route_of`: empty if no routes
/// are asked for.
void write_delta(json_writer& w, const table_owner& who, const membership& others, const table_question& asked,
                 std::size_t longest, time_point now, const route_function& route_of = {});

/// Writes the body of `PUSH self:cles/peers` with this node's own entry.
void write_own_entry(json_writer& w, const incarnation& own, time_point now);

/// A table as received.
struct peer_table {
    std::string node;  ///< that replies; empty if missing
    std::string epoch; ///< as text
    std::string pool;  ///< of that node
    std::string next;  ///< empty: the node always sends its whole table
    bool more = false;
    std::vector<peer_report> reports;
    std::vector<peer_heartbeat> beats;
    struct route {
        std::uint32_t epoch = 0;
        route_advert advert;
    };
    std::vector<route> routes;   ///< from the node that replies
    std::vector<route> wanted;   ///< numbers that it needs; hops: over how many links that may still spread
    std::size_t bad_entries = 0; ///< that could not be read, and were skipped
};

/// Writes the body of `PUSH self:cles/peers` with routes that have changed, and numbers that are needed.
void write_routes(json_writer& w, const table_owner& who, std::string_view pool,
                  const std::vector<peer_table::route>& routes, const std::vector<peer_table::route>& wanted);

/// How the entries of tables are written.
enum class entry_form : std::uint8_t {
    plain,
    signed_by_node, ///< with the announcement as it was signed (docs/protocol_security.md, "Announcements")
};

/// Reads a reply, or a table sent without a request; the entries beyond `max_entries` are skipped. `usual`: the
/// interval of entries without one. Returns false if it is not a table; `out` has the entries before the error. The
/// signatures of entries are not verified.
bool read_table(std::string_view json, std::size_t max_entries, std::chrono::milliseconds usual, peer_table& out,
                entry_form form = entry_form::plain);

/// Reads the name, epoch, endpoints and pool from the reply to `PULL self:cles`. Returns false if the name or the epoch
/// is missing.
bool read_description(std::string_view json, std::chrono::milliseconds usual, peer_report& out);

} // namespace cles::core
