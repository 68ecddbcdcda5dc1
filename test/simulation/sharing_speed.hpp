// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/world/work_report.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace cles::simulation {

/// Two nodes that share their jobs, of which all are submitted to one at the same time.
struct shared_burst {
    /// Jobs of one kind.
    struct kind {
        std::string task;
        std::chrono::milliseconds work;
    };

    std::size_t workers = 1;                                          ///< of the node to which they are submitted
    std::size_t other_workers = 8;                                    ///< of the other node
    std::vector<kind> kinds{{"work", std::chrono::milliseconds{10}}}; ///< as many jobs of each, in random order
    unsigned jobs = 1'800;
    /// The other node has run one job of the first kind that took this long, and nothing since.
    std::chrono::milliseconds before{0};
};

struct burst_report {
    std::vector<violation> violations;
    double seconds = 0;      ///< from the first job to the last result
    double ideal = 0;        ///< if all workers always had a job
    double work = 0;         ///< of all jobs
    double idle_seconds = 0; ///< of workers, while jobs that may move waited
    std::size_t moved = 0;
    std::size_t returned = 0;
};
/// In one line.
std::string to_text(const burst_report& r);

/// Simulates that in virtual time, on a local network: how much of the time of the workers is used.
burst_report simulate_burst(std::uint64_t seed, const shared_burst& setup);

} // namespace cles::simulation
