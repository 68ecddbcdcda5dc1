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

/// What a middleware takes of a machine, as the kernel knows it.
struct footprint {
    std::uint64_t peak_kib = 0; ///< the most that was resident, VmHWM
    std::map<std::string, std::uint64_t>
        libraries; ///< shared ones besides those of C and C++: path to bytes in the file
};

/// \throws std::runtime_error where there is no such process
footprint footprint_of(pid_t process);

/// Of this process's own program: what of its file is loaded, that is code and data without symbols.
std::uint64_t loaded_program_bytes();

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
