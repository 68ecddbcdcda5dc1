// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "options.hpp"
#include "peer.hpp"
#include "perf/support/latency_recorder.hpp"

#include <cstdint>
#include <map>
#include <string>

#include <sys/types.h>

namespace cles::perf::peers {

/// What a process uses, as the kernel reports it.
struct footprint {
    std::uint64_t peak_kib = 0; ///< most resident memory, VmHWM
    std::map<std::string, std::uint64_t>
        libraries; ///< shared ones besides those of C and C++: path to bytes in the file
};

/// \throws std::runtime_error if there is no such process
footprint footprint_of(pid_t process);

/// The loaded size of this program: code and data without symbols.
std::uint64_t loaded_program_bytes();

struct figures {
    std::uint64_t count = 0; ///< calls or deliveries that were measured
    latencies latency;
    double per_second = 0;
    double cpu_us = 0;                           ///< of all processes, for each call or delivery
    double lost = 0;                             ///< the share of the deliveries that did not arrive
    std::map<std::string, footprint> footprints; ///< of each process, by its role
    std::uint64_t program_bytes = 0;
};

/// Measures one peer in one way: starts its server, warms it up, sends requests or has it publish.
/// \throws not_offered
figures measure(const options& how);

/// As one line of JSON.
std::string to_text(const options& how, const figures& what);
std::string about_text();

} // namespace cles::perf::peers
