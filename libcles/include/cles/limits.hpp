// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/boottime_clock.hpp>

#include <chrono>
#include <cstddef>

namespace cles {

/// Points in time are steady: no clock of the day moves a deadline, and none waits for a machine that is suspended.
using time_point = boottime_clock::time_point;

/// The bounds within which a service stays, whatever its peers do (docs/protocol.md, "Limits"). Past a count, requests
/// are answered `busy`; past a size, `too_large`. Behind each is what it may be; a service whose limits are outside of
/// that is refused with `invalid_option` (see <cles/limit_ranges.hpp>).
struct limits {
    std::size_t line = 1U << 20U; ///< bytes of a line or reply on a stream; 256 to 64 MiB
    std::size_t depth = 32;       ///< brackets of JSON, the outermost being 1; 1 to 64
    std::size_t links = 1024;     ///< links that others opened; 1 to 1,000,000, like all counts below
    /// Of these, what one address keeps when others need room; 0: three quarters of them.
    std::size_t links_per_address = 0;
    std::size_t in_flight = 4096; ///< requests per link that wait or run
    std::size_t bindings = 1024;  ///< bindings per link
    std::size_t nouns = 4096;     ///< nouns per task that are published or bound; see `service::retire`
    std::size_t running = 16384;  ///< handlers of the service that have not ended
    /// Bytes of replies that a peer leaves unread before its link is not read; 1 to 1 GiB.
    std::size_t unread = 1U << 20U;
    /// Bytes of requests that wait for their turn before a link is not read; 1 to 1 GiB.
    std::size_t waiting = 1U << 20U;
    /// Bytes of updates queued for a binding; 1 KiB to 1 GiB.
    std::size_t binding_bytes = 4U << 20U;
    /// Bytes of requests by datagram and their replies, of all sources; 1 KiB to 1 GiB.
    std::size_t remembered = 16U << 20U;
    std::size_t peers = 1024;        ///< other nodes that are known because they announce themselves
    std::size_t group_leases = 4096; ///< bindings by multicast; of one source at most `bindings`
    std::size_t publishers = 1024;   ///< whose updates of one noun a feed of `all:` tells apart
    std::size_t feed = 1024;         ///< updates that a feed holds for a caller who does not fetch them
    /// Bytes that the node holds for its peers at once: requests that wait or run, results and requests that a peer has
    /// not taken yet, last values, updates that are queued. Past it new work is `busy`, and no link holds more than is
    /// left for others. 64 KiB to 1 TiB.
    std::size_t memory = 256U << 20U;
    /// A link whose peer takes nothing for so long is closed; 1 ms to a day.
    std::chrono::milliseconds stall{30'000};
    /// What feeds ask for by datagram; they renew at a third of it; 20 ms to a minute.
    std::chrono::milliseconds lease{10'000};
    /// A connection that is not made within this has failed; 1 ms to a day.
    std::chrono::milliseconds connect{5'000};
    /// How long input is discarded before a link closes; 1 ms to a day.
    std::chrono::milliseconds discard{1'000};
    /// A link that others opened and that brings no whole line for so long is closed; up to a day; 0: never.
    std::chrono::milliseconds first_line{60'000};
    /// How long after a peer has ended its stream it is probed first, then at three times that, and every 15 s at
    /// least; 1 ms to a day.
    std::chrono::milliseconds probe{5'000};
};

} // namespace cles
