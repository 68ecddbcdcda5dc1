// SPDX-License-Identifier: BSL-1.0
#include "pinning.hpp"

#include "descriptor.hpp"

#include <sched.h>

namespace cles::perf {

std::vector<int> usable_cores() {
    cpu_set_t set;
    CPU_ZERO(&set);
    checked(::sched_getaffinity(0, sizeof set, &set), "sched_getaffinity");
    std::vector<int> cores;
    for (int core = 0; core < CPU_SETSIZE; ++core) {
        if (CPU_ISSET(static_cast<std::size_t>(core), &set)) {
            cores.push_back(core);
        }
    }
    return cores;
}

void pin_to(int core) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(core), &set);
    checked(::sched_setaffinity(0, sizeof set, &set), "sched_setaffinity");
}

placement place_ends() {
    const auto cores = usable_cores();
    return {.client = cores.back(), .server = cores.size() > 1 ? cores[cores.size() - 2] : cores.back()};
}

} // namespace cles::perf
