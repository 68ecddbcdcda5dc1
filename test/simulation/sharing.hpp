// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/planted.hpp"
#include "simulation/world/work_report.hpp"

#include <cstdint>

namespace cles::simulation {

/// A mesh of nodes that share their jobs.
struct sharing_setup {
    unsigned nodes = 200;
    unsigned mean_degree = 4;
    unsigned clients = 200; ///< that submit jobs, each by a link to one node
    unsigned jobs = 100'000;
    unsigned faults_per_minute = 6; ///< for each node; 0: nothing goes wrong
};

/// Simulates nodes that share their jobs in virtual time. Most have no link to each other. Clients submit jobs, by name
/// and to `any`, most of them in bursts to a few nodes, by streams and by datagrams; they cancel some. Meanwhile nodes
/// crash, stop in order, are suspended and restart, links are lost, datagrams are lost, and the mesh is cut in two. No
/// job may run twice, each has to end in time as its reply says, and no pool may exceed its limits. When the faults
/// have ended, jobs have to succeed; when all jobs have ended, nothing may be left.
work_report simulate_sharing(std::uint64_t seed, const sharing_setup& setup, planted fault = planted::none);

} // namespace cles::simulation
