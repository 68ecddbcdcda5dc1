// SPDX-License-Identifier: BSL-1.0
#pragma once

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

} // namespace cles::perf::peers
