// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sysinfo {

struct process {
    std::int64_t pid = 0;
    std::string name;
    std::string state; ///< "R" runs, "S" sleeps, "D" waits for a device, "T" stopped, "Z" ended, not yet fetched
    std::uint64_t threads = 0;
    std::uint64_t cpu_ms = 0; ///< that it has used since it began
    std::uint64_t memory = 0; ///< bytes that it has in memory
};
BOOST_DESCRIBE_STRUCT(process, (), (pid, name, state, threads, cpu_ms, memory))

struct processes {
    std::uint64_t count = 0;
    std::uint64_t threads = 0;
    std::vector<process> largest; ///< by memory, the largest first
};
BOOST_DESCRIBE_STRUCT(processes, (), (count, threads, largest))

/// What the kernel counts in.
struct kernel_units {
    std::uint64_t ticks_per_second = 100;
    std::uint64_t page = 4096; ///< bytes
};

/// Reads /proc/<pid>/stat; nothing where it is none.
std::optional<process> parse_process(std::string_view stat, const kernel_units& units);

/// Keeps those that use the most memory.
processes summed_up(std::vector<process> all, std::size_t most_listed);

processes read_processes(std::size_t most_listed);

} // namespace sysinfo
