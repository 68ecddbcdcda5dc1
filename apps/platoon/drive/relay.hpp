// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/simulation/gilbert_elliott.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace platoon {

/// What a relay has carried from one vehicle to another.
struct relayed_link {
    std::string from{}, to{};
    std::uint64_t delivered = 0, lost = 0; ///< packets
};
BOOST_DESCRIBE_STRUCT(relayed_link, (), (from, to, delivered, lost))

/// The same of all of them. What a vehicle's device did not take is not delivered, though its link counts it.
struct relay_count {
    std::uint64_t delivered = 0, lost = 0, overflown = 0;
    std::vector<relayed_link> links{};
};
BOOST_DESCRIBE_STRUCT(relay_count, (), (delivered, lost, overflown, links))

struct relay_options {
    std::vector<int> devices{}; ///< of each vehicle, in their order
    std::string listen{};       ///< the URL at which it is asked
    gilbert_elliott losses{};
    double delay = 0;
    std::uint64_t seed = 1;
};

/// The name of its node.
inline constexpr const char* relay_name = "relay";

/// Carries packets between the networks of vehicles, and loses and delays them as a bad radio does, until SIGTERM:
/// those to the group from each vehicle to all others, the rest to the one that has the address. It is a node itself,
/// with the task PULL `links`, whose reply is a `relay_count`.
void run_relay(const relay_options& options);

} // namespace platoon
