// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "footprint.hpp"
#include "options.hpp"
#include "peer.hpp"
#include "perf/latency_recorder.hpp"

#include <cstdint>
#include <map>
#include <string>

namespace cles::perf::peers {

struct figures {
    std::uint64_t count = 0; ///< calls or deliveries that were measured
    latencies latency;
    double per_second = 0;
    double cpu_us = 0;                           ///< of all processes, for each call or delivery
    double lost = 0;                             ///< the part of the deliveries that never came
    std::map<std::string, footprint> footprints; ///< of each process, by what it is
    std::uint64_t program_bytes = 0;
};

/// Measures one peer in one way: starts its server, warms it up, asks it or has it publish.
/// \throws not_offered
figures measure(const options& how);

/// As one line of JSON.
std::string to_text(const options& how, const figures& what);
std::string about_text();

} // namespace cles::perf::peers
