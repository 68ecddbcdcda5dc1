// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/graph.hpp"
#include "simulation/network/planted.hpp"
#include "simulation/world/work_report.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace cles::simulation {

/// A mesh to simulate.
struct mesh_setup {
    mesh_form form = mesh_form::random;
    unsigned nodes = 16;
    unsigned mean_degree = 4; ///< of a random mesh
    bool declared = true;     ///< by the `links` of each node; otherwise other links cannot be opened
    unsigned cuts = 3;        ///< links that are lost, one after another, each of which leaves the mesh connected
    unsigned crashes = 1;
    unsigned requests = 200; ///< after each change
    unsigned hops = 8;       ///< of each request, which must not arrive over more than one link more
    bool secured = false;    ///< they are members of a fleet, and all may forward
};

/// The result of a simulated mesh.
struct mesh_report {
    std::vector<violation> violations;
    std::chrono::milliseconds converged{0}; ///< until all nodes had the shortest routes to all others
    std::chrono::milliseconds rerouted{0};  ///< the longest time from the loss of a link to the first reply by another
    std::chrono::milliseconds all_rerouted{0}; ///< the longest time from there until all pairs over it had another way
    std::size_t cut = 0;                       ///< how many these were
    std::uint64_t bytes = 0;                   ///< received by a node in an interval without changes, on average
    std::uint64_t bytes_of_routes = 0;         ///< among them
    request_tally requests{};
    unsigned longest = 0; ///< route, in links
};

/// In one line.
std::string to_text(const mesh_report& r);

/// Simulates nodes that route for each other in virtual time, where most have no link to each other. The routes have to
/// become the shortest ones. Then links are lost silently and nodes crash; requests have to find another way
/// within one interval, and none may run twice.
mesh_report simulate_mesh(std::uint64_t seed, const mesh_setup& setup, planted fault = planted::none);

} // namespace cles::simulation
