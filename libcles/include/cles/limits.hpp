// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/boottime_clock.hpp>

#include <chrono>
#include <cstddef>

namespace cles {

/// Points in time are steady: no clock of the day moves a deadline, and none waits for a machine that is suspended.
using time_point = boottime_clock::time_point;

/// The bounds within which a service stays, whatever its peers do (docs/protocol.md, "Limits"). Past a count, requests
/// are answered `busy`; past a size, `too_large`.
struct limits {
    std::size_t line = 1U << 20U;            ///< bytes of a line or reply on a stream
    std::size_t depth = 32;                  ///< brackets of JSON, the outermost being 1
    std::size_t links = 1024;                ///< links that others opened
    std::size_t in_flight = 4096;            ///< requests per link that wait or run
    std::size_t bindings = 1024;             ///< bindings per link
    std::size_t nouns = 4096;                ///< nouns per task that are published or bound
    std::size_t running = 16384;             ///< handlers of the service that have not ended
    std::size_t unread = 1U << 20U;          ///< bytes of replies that a peer leaves unread before its link is not read
    std::size_t waiting = 1U << 20U;         ///< bytes of requests that wait for their turn before a link is not read
    std::size_t binding_bytes = 4U << 20U;   ///< bytes of updates queued for a binding
    std::size_t remembered = 16U << 20U;     ///< bytes of requests by datagram and their replies, of all sources
    std::size_t peers = 1024;                ///< other nodes that are known because they announce themselves
    std::size_t group_leases = 4096;         ///< bindings by multicast; of one source at most `bindings`
    std::size_t publishers = 1024;           ///< whose updates of one noun a feed by multicast tells apart
    std::size_t feed = 1024;                 ///< updates that a feed holds for a caller who does not fetch them
    std::chrono::milliseconds stall{30'000}; ///< a link whose peer takes nothing for so long is closed
    std::chrono::milliseconds lease{10'000}; ///< what feeds ask for by datagram; they renew at a third of it
    std::chrono::milliseconds connect{5'000}; ///< a connection that is not made within this has failed
    std::chrono::milliseconds discard{1'000}; ///< how long input is discarded before a link closes
};

} // namespace cles
