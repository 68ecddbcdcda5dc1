// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstdint>
#include <string_view>

namespace sysinfo {

/// What the cores did since the machine started, in ticks of the kernel.
struct cpu_times {
    std::uint64_t busy = 0;
    std::uint64_t all = 0;
};

/// Reads the first line of /proc/stat.
cpu_times parse_cpu_times(std::string_view stat);

/// How busy the cores are, from two readings that lie a while apart.
class cpu_use {
  public:
    /// The readings before it are at least so far back, so that they mean something.
    static constexpr std::chrono::milliseconds shortest{100};

    /// Takes a reading, and returns the part of the cores' time that was spent working since an earlier one, 0 to 1. At
    /// first that is since the machine started.
    double take(const cpu_times& reading, cles::time_point now);

  private:
    struct dated {
        cpu_times times{};
        cles::time_point at{};
    };
    dated before_{}; ///< at least `shortest` older than what is asked about
    dated last_{};
};

} // namespace sysinfo
