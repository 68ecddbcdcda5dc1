// SPDX-License-Identifier: BSL-1.0
#include "daemon/idle_memory.hpp"

#include "system/whole_file.hpp"

#include <cstdlib>
#include <ctime>
#include <sstream>
#include <string>
#include <utility>

#include <unistd.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace cles::runtime {
namespace {

bool has_grown(std::uint64_t now, std::uint64_t before) noexcept {
    return now > before && now - before >= idle_memory::enough;
}

} // namespace

process_usage usage_of_process() {
    process_usage found;
    std::string text;
    static_cast<void>(tool::read_file("/proc/self/statm", text)); // empty if it cannot be read
    std::istringstream pages{text};
    std::uint64_t all = 0;
    std::uint64_t resident = 0;
    if (pages >> all >> resident) {
        found.resident = resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    }
#ifdef __GLIBC__
    found.unused = ::mallinfo2().fordblks;
#endif
    timespec used{};
    if (::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used) == 0) {
        found.cpu_time = std::chrono::seconds{used.tv_sec} + std::chrono::nanoseconds{used.tv_nsec};
    }
    return found;
}

void keep_little_memory() noexcept {
#ifdef __GLIBC__
    // Stating either of them, nothing that is freed changes them.
    constexpr int largest_kept = 256 * 1024; // bytes
    constexpr int most_at_end = 512 * 1024;
    for (const char* stated : {"GLIBC_TUNABLES", "MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"}) {
        if (std::getenv(stated) != nullptr) {
            return;
        }
    }
    ::mallopt(M_MMAP_THRESHOLD, largest_kept);
    ::mallopt(M_TRIM_THRESHOLD, most_at_end);
#endif
}

void return_unused_memory() noexcept {
#ifdef __GLIBC__
    ::malloc_trim(0);
#endif
}

// What has been returned still counts as unused, so more of it is needed; or it has been used again, and is resident.
bool idle_memory::is_time(const process_usage& now) noexcept {
    const auto used = now.cpu_time - std::exchange(known_.cpu_time, now.cpu_time);
    return used <= idle_cpu_time && (has_grown(now.unused, known_.unused) || has_grown(now.resident, known_.resident));
}

} // namespace cles::runtime
