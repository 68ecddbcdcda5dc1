// SPDX-License-Identifier: BSL-1.0
#include "process_memory.hpp"

#include <fstream>

#include <malloc.h>
#include <unistd.h>

namespace cles::perf {

process_memory memory_now() {
    std::ifstream statm{"/proc/self/statm"};
    std::uint64_t all = 0;
    std::uint64_t resident = 0;
    statm >> all >> resident;
    const auto heap = ::mallinfo2();
    return {resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)), heap.uordblks + heap.hblkhd};
}

} // namespace cles::perf
