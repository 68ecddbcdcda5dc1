// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/world/witness.hpp"

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace cles::simulation {

/// What became of the requests of simulated clients.
struct request_tally {
    std::size_t asked = 0;
    std::size_t succeeded = 0;
    std::map<std::string, std::size_t> failed{}; ///< by code

    [[nodiscard]] std::size_t failed_in_all() const noexcept { return asked - succeeded; }
};
/// Such as "100 asked, 90 succeeded, 7 busy, 3 deadline".
std::string to_text(const request_tally& t);

/// The result of simulated nodes that run jobs.
struct work_report {
    std::vector<violation> violations{};
    request_tally jobs{};
    std::size_t moved = 0;    ///< sent to other nodes, and not returned
    std::size_t returned = 0; ///< refused by other nodes
    std::size_t grants = 0;   ///< of nodes, at the end
    std::size_t faults = 0;   ///< that befell nodes and links
    double seconds = 0;       ///< of virtual time
};
/// In one line.
std::string to_text(const work_report& r);

} // namespace cles::simulation
