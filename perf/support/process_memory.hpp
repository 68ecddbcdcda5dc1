// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>

namespace cles::perf {

/// What a process holds, in bytes.
struct process_memory {
    std::uint64_t resident = 0;
    std::uint64_t allocated = 0; ///< by malloc
};
BOOST_DESCRIBE_STRUCT(process_memory, (), (resident, allocated))

/// Of this process.
process_memory memory_now();

} // namespace cles::perf
