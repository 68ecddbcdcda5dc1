// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <boost/describe/class.hpp>

#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace cles::core {

/// Counts durations in buckets of increasing width (eight per doubling, so a quantile is accurate to 12.5 %).
class latency_histogram {
  public:
    void record(std::chrono::nanoseconds duration) noexcept {
        const auto ns = duration.count() < 0 ? 0U : static_cast<std::uint64_t>(duration.count());
        ++buckets_[bucket_of(ns)];
        ++count_;
    }

    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

    /// The upper bound of the bucket that holds the quantile: the smallest duration that a share `q` of all does not
    /// exceed; 0 if nothing was recorded.
    [[nodiscard]] std::chrono::nanoseconds quantile(double q) const noexcept {
        const auto wanted = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(count_)));
        std::uint64_t seen = 0;
        for (std::size_t i = 0; i < buckets_.size(); ++i) {
            seen += buckets_[i];
            if (buckets_[i] != 0 && seen >= wanted) {
                return std::chrono::nanoseconds{upper_bound(i)};
            }
        }
        return {};
    }

  private:
    static constexpr unsigned sub_bits = 3;
    static constexpr std::size_t sub = 1U << sub_bits;

    static constexpr std::size_t bucket_of(std::uint64_t ns) noexcept {
        if (ns < sub) {
            return static_cast<std::size_t>(ns);
        }
        const auto shift = static_cast<unsigned>(std::bit_width(ns)) - 1 - sub_bits;
        const auto index = (static_cast<std::size_t>(shift) + 1) * sub + ((ns >> shift) & (sub - 1));
        return index < bucket_count ? index : bucket_count - 1;
    }
    static constexpr std::int64_t upper_bound(std::size_t index) noexcept {
        if (index < sub) {
            return static_cast<std::int64_t>(index);
        }
        const auto shift = index / sub - 1;
        return static_cast<std::int64_t>(((sub + index % sub + 1) << shift) - 1);
    }

    static constexpr std::size_t bucket_count = 40 * sub; // up to about an hour
    std::array<std::uint64_t, bucket_count> buckets_{};
    std::uint64_t count_ = 0;
};

/// What a service has counted since its start; shown by `PULL self:cles/metrics` in the order of its description below.
struct counters {
    std::array<std::uint64_t, verb_count> requests{}; ///< served, by verb
    std::uint64_t errors = 0;                         ///< answered with an error
    std::uint64_t errors_unsent = 0;                  ///< errors that were not sent because of reply=no
    std::uint64_t housekeeping = 0;        ///< for membership, task discovery and sharing; not counted in `requests`
    std::uint64_t housekeeping_errors = 0; ///< of these, failed
    std::uint64_t requests_repeated = 0;   ///< by datagram, and so not run again
    std::uint64_t requests_sent = 0;
    std::uint64_t requests_resent = 0; ///< retransmitted by datagram
    std::uint64_t replies_dropped = 0; ///< malformed, or for no request in flight
    std::uint64_t updates_published = 0;
    std::uint64_t nouns_retired = 0;     ///< last values that were forgotten
    std::uint64_t updates_delivered = 0; ///< to subscribers on links
    std::uint64_t updates_shed = 0;      ///< dropped for slow subscribers
    std::uint64_t updates_too_large = 0; ///< not sent by datagram
    std::uint64_t updates_received = 0;  ///< and delivered to a feed
    std::uint64_t updates_dropped = 0;   ///< unwanted, repeated or malformed
    std::uint64_t updates_unsigned = 0;  ///< dropped, because they are not signed as their publisher announces
    std::uint64_t announcements_sent = 0;
    std::uint64_t announcements_received = 0; ///< from others, and accepted
    std::uint64_t announcements_dropped = 0;  ///< malformed or old
    std::uint64_t announcements_foreign = 0;  ///< from nodes of other pools
    std::uint64_t peers_known = 0;            ///< filled in when they are shown
    std::uint64_t peers_refused = 0;          ///< announcements of nodes beyond the limit
    std::uint64_t tables_asked = 0;           ///< requested from others, by gossip
    std::uint64_t tables_failed = 0;          ///< of these: refused, late, or malformed
    std::uint64_t tables_told = 0;            ///< sent to others
    std::uint64_t entries_dropped = 0;        ///< entries of tables that could not be parsed
    std::uint64_t grants_sent = 0;            ///< of free slots, to other nodes
    std::uint64_t grants_received = 0;        ///< from other nodes
    std::uint64_t granted_jobs_refused = 0;   ///< jobs of other nodes that came without a valid grant, or may not move
    std::uint64_t jobs_moved_in = 0;          ///< jobs of other nodes that were run here, and have ended
    std::uint64_t jobs_moved_out = 0;         ///< jobs that were sent to other nodes, and have ended
    std::uint64_t leases_expired = 0;
    std::uint64_t datagrams_withheld = 0; ///< to unverified addresses, beyond their share
    std::uint64_t datagrams_unsealed = 0; ///< dropped with security; filled in when they are shown
    std::uint64_t group_unopened = 0;     ///< sealed for others than this node; filled in when they are shown
    std::uint64_t group_received = 0;     ///< datagrams of the multicast group, other than its own
    std::uint64_t group_dropped = 0;      ///< of these: neither BIND nor update, or malformed, or beyond a limit
    std::uint64_t group_repeated = 0;     ///< copies, from nodes that send on several interfaces
    std::uint64_t group_copied = 0;       ///< from a source that is not their sender's: others have repeated them
    std::uint64_t group_sent = 0;
    std::uint64_t group_unsent = 0; ///< too large, or too much was pending
    std::uint64_t group_failed = 0; ///< not sent by the system, as when an interface is down
    std::uint64_t links_accepted = 0;
    std::uint64_t links_refused = 0;
    std::uint64_t links_evicted = 0; ///< closed in favour of others
    std::uint64_t links_lost = 0;
    std::uint64_t bytes_received = 0;
    std::uint64_t bytes_sent = 0;
    std::uint64_t group_leases = 0; ///< live now
    std::uint64_t links_open = 0;
    std::uint64_t handlers_running = 0;
    std::uint64_t routed = 0; ///< of these, requests that wait for other nodes
};
BOOST_DESCRIBE_STRUCT(counters, (),
                      (errors, errors_unsent, housekeeping, housekeeping_errors, handlers_running, routed,
                       requests_repeated, requests_sent, requests_resent, replies_dropped, updates_published,
                       nouns_retired, updates_delivered, updates_shed, updates_too_large, updates_received,
                       updates_dropped, updates_unsigned, announcements_sent, announcements_received,
                       announcements_dropped, announcements_foreign, peers_known, peers_refused, tables_asked,
                       tables_failed, tables_told, entries_dropped, grants_sent, grants_received, granted_jobs_refused,
                       jobs_moved_in, jobs_moved_out, leases_expired, datagrams_withheld, datagrams_unsealed,
                       group_received, group_dropped, group_repeated, group_copied, group_unopened, group_sent,
                       group_unsent, group_failed, group_leases, links_open, links_accepted, links_refused,
                       links_evicted, links_lost, bytes_received, bytes_sent))

} // namespace cles::core
