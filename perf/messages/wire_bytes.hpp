// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/localization.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace cles::perf {

/// The bytes of one exchange of the localization packet, without the headers of lower layers.
struct exchange_bytes {
    double request = 0;
    double reply = 0;
};

/// For each verb: means over a number of exchanges, because values and numbers differ in length.
struct verb_bytes {
    exchange_bytes pull{};     ///< the reply has the packet
    exchange_bytes push{};     ///< the request has the packet
    exchange_bytes delegate{}; ///< both have the packet
    exchange_bytes ask{};      ///< an UPDATE that asks a node to publish the packet
    exchange_bytes bind{};     ///< the reply has the last packet; one exchange
    double update = 0;         ///< a published packet, which has no reply
};

/// The nth values of the packet.
using packet_source = const localization& (*)(std::uint64_t n) noexcept;

/// Measured by a relay between two services of this process, over "tcp" or "udp".
/// \throws cles::error if an exchange fails
verb_bytes measure_bytes(const std::string& scheme, std::uint64_t exchanges, packet_source packets);

} // namespace cles::perf
