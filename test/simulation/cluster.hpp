// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/planted.hpp"
#include "simulation/world/witness.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cles::simulation {

/// What came of a cluster's life.
struct cluster_report {
    std::vector<violation> violations;
    std::size_t succeeded = 0; ///< of the client's requests
    std::size_t failed = 0;
    std::size_t refused = 0; ///< of those that failed
};

/// The life of a cluster in virtual time: one node that routes, three that work for it as daemons do, and a client that
/// asks for `any` and `all`. Workers and the router crash, stop and begin again, their clocks jump, and links and ways
/// are cut, in one direction too. After the trouble comes calm, in which requests have to succeed, then silence.
cluster_report simulate_cluster(std::uint64_t seed, std::chrono::seconds trouble, planted fault = planted::none);

} // namespace cles::simulation
