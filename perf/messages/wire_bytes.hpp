// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace cles::perf {

/// What one exchange of the localization packet puts on the wire, without the headers below it.
struct exchange_bytes {
    double request = 0;
    double reply = 0;
};

/// Of each verb, in the means over a number of exchanges, since values and numbers differ in length.
struct verb_bytes {
    exchange_bytes pull{};     ///< asks for the packet, gets it
    exchange_bytes push{};     ///< brings the packet, gets an acknowledgement
    exchange_bytes delegate{}; ///< brings the packet, gets it back
    exchange_bytes ask{};      ///< an UPDATE that asks a node to publish the packet, gets an acknowledgement
    exchange_bytes bind{};     ///< gets the last packet; of one exchange
    double update = 0;         ///< a published packet on its way to a binder: nobody answers
};

/// Measured by a relay between two services of this process, over "tcp" or "udp".
/// \throws cles::error where an exchange fails
verb_bytes measure_bytes(const std::string& scheme, std::uint64_t exchanges);

} // namespace cles::perf
