// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/planted.hpp"
#include "simulation/world/work_report.hpp"

#include <chrono>
#include <cstdint>

namespace cles::simulation {

/// Simulates a cluster in virtual time: one node that routes, three workers that serve as daemons do, and a client that
/// sends requests to `any` and `all`. Workers and the router crash, are suspended and restart, their clocks jump, links
/// are lost, and networks are partitioned, also in one direction. After the faults comes a period in which requests
/// have to succeed, then one without activity. \param sharing the workers share their jobs
work_report simulate_cluster(std::uint64_t seed, std::chrono::seconds trouble, planted fault = planted::none,
                             bool sharing = false);

} // namespace cles::simulation
