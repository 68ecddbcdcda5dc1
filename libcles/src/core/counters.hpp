// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <array>
#include <cstdint>

namespace cles::core {

/// What a service counts from its start on; shown by `PULL self:cles/metrics`.
struct counters {
    std::array<std::uint64_t, verb_count> requests{}; ///< served, by verb
    std::uint64_t errors = 0;                         ///< answered with an error
    std::uint64_t errors_unsent = 0;                  ///< not answered with one because of reply=no
    std::uint64_t housekeeping = 0;                   ///< requests by which nodes know of each other: not among those
    std::uint64_t housekeeping_errors = 0;            ///< of these, answered with an error or not at all
    std::uint64_t requests_repeated = 0;              ///< by datagram, and so not run again
    std::uint64_t requests_sent = 0;
    std::uint64_t requests_resent = 0; ///< copies, by datagram
    std::uint64_t replies_dropped = 0; ///< malformed, or answering nothing in flight
    std::uint64_t updates_published = 0;
    std::uint64_t nouns_retired = 0;     ///< last values that were forgotten
    std::uint64_t updates_delivered = 0; ///< to binders on links
    std::uint64_t updates_shed = 0;      ///< dropped for binders that were slow
    std::uint64_t updates_too_large = 0; ///< not sent by datagram
    std::uint64_t updates_received = 0;  ///< and handed to a feed
    std::uint64_t updates_dropped = 0;   ///< unwanted, repeated or malformed
    std::uint64_t announcements_sent = 0;
    std::uint64_t announcements_received = 0; ///< of others, and taken
    std::uint64_t announcements_dropped = 0;  ///< malformed or old
    std::uint64_t announcements_foreign = 0;  ///< of nodes of other pools
    std::uint64_t peers_refused = 0;          ///< announcements of nodes past the limit
    std::uint64_t tables_asked = 0;           ///< of others, by gossip
    std::uint64_t tables_failed = 0;          ///< of these: refused, late, or no tables
    std::uint64_t tables_told = 0;            ///< to others
    std::uint64_t entries_dropped = 0;        ///< of tables, since they could not be read
    std::uint64_t leases_expired = 0;
    std::uint64_t datagrams_withheld = 0; ///< to strangers who would have got too much
    std::uint64_t group_received = 0;     ///< datagrams of the multicast group, other than its own
    std::uint64_t group_dropped = 0;      ///< of these: neither BIND nor update, or malformed, or past a limit
    std::uint64_t group_repeated = 0;     ///< what had come before, of nodes that send by several interfaces
    std::uint64_t group_sent = 0;
    std::uint64_t group_unsent = 0; ///< too large, or too much waited already
    std::uint64_t links_accepted = 0;
    std::uint64_t links_refused = 0;
    std::uint64_t links_evicted = 0; ///< closed to make room for others
    std::uint64_t links_lost = 0;
    std::uint64_t bytes_received = 0;
    std::uint64_t bytes_sent = 0;
    std::uint64_t group_leases = 0; ///< that live now
    std::uint64_t links_open = 0;
    std::uint64_t handlers_running = 0;
    std::uint64_t routed = 0; ///< of these, requests that wait for other nodes
};

} // namespace cles::core
