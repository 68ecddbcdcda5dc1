// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/boottime_clock.hpp>
#include <cles/chrono.hpp>

#include <cstddef>

namespace cles {

/// Points in time are steady: deadlines do not move when the system time is set, and expire while the machine is
/// suspended.
using time_point = boottime_clock::time_point;

/// Limits on the resources that a service's peers can make it use (docs/protocol.md, "Limits"). When a count is
/// exceeded, requests fail with `busy`; when a size is, with `too_large`. Each comment ends with the range. A service
/// whose limits are out of range is refused with `invalid_option` (see <cles/limit_ranges.hpp>).
struct limits {
    std::size_t line = 1U << 20U; ///< bytes of a line or reply on a stream; 256 to 64 MiB
    std::size_t depth = 32;       ///< nested brackets of JSON, the outermost being 1; 1 to 64
    std::size_t links = 1024;     ///< links opened by peers; 1 to 1,000,000, like all counts below
    /// Of these, how many one address keeps when other addresses need links; 0: three quarters of them.
    std::size_t links_per_address = 0;
    std::size_t in_flight = 4096; ///< requests per link that are queued or running
    std::size_t bindings = 1024;  ///< bindings per link
    std::size_t nouns = 4096;     ///< nouns per task that are published or bound; see `service::retire`
    std::size_t running = 16384;  ///< handlers of the service that have not finished
    /// While a peer leaves more bytes of replies than this unread, its link is not read; 1 to 1 GiB.
    std::size_t unread = 1U << 20U;
    /// While a link has more bytes of queued requests than this, it is not read; 1 to 1 GiB.
    std::size_t waiting = 1U << 20U;
    /// Bytes of updates queued for a binding; 1 KiB to 1 GiB.
    std::size_t binding_bytes = 4U << 20U;
    /// Bytes of requests received as datagrams and their replies, of all sources; 1 KiB to 1 GiB.
    std::size_t remembered = 16U << 20U;
    std::size_t peers = 1024;        ///< other nodes known by their announcements
    std::size_t group_leases = 4096; ///< multicast bindings; at most `bindings` per source
    std::size_t publishers = 1024;   ///< publishers of one noun that a feed of `all:` distinguishes
    std::size_t feed = 1024;         ///< updates that a feed queues until they are fetched
    /// Bytes that the node holds for all its peers: queued and running requests, results and requests that a peer has
    /// not read yet, last values, queued updates. Beyond it, new work is `busy`. No link holds more than remains free
    /// for the others. 64 KiB to 1 TiB.
    std::size_t memory = 256U << 20U;
    /// A link is closed if its peer reads nothing for this long; 1 ms to a day.
    std::chrono::milliseconds stall{30'000};
    /// The lease that feeds request by datagram; they renew it after a third of this; 20 ms to a minute.
    std::chrono::milliseconds lease{10'000};
    /// A connection attempt fails after this; 1 ms to a day.
    std::chrono::milliseconds connect{5'000};
    /// How long input is discarded before a link closes; 1 ms to a day.
    std::chrono::milliseconds discard{1'000};
    /// A link opened by a peer is closed if it receives no whole line for this long; up to a day; 0: never.
    std::chrono::milliseconds first_line{60'000};
    /// When a peer that has ended its stream is first probed; again after three times that, and at least every 15 s; 1
    /// ms to a day.
    std::chrono::milliseconds probe{5'000};
    /// While something is bound at a node or a reply of it is awaited, on a stream, that node may be silent for this
    /// long. After a third of it, it is asked whether it is alive; only what is known to be a node is asked. A node
    /// whose handler keeps its thread busy for longer cannot answer. Up to a day; 0: for ever.
    std::chrono::milliseconds silence{10'000};
};

} // namespace cles
