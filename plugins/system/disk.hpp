// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace sysinfo {

/// A mounted file system; sizes in bytes.
struct file_system {
    std::string mount; ///< where
    std::string device;
    std::string type;
    std::uint64_t size = 0;
    std::uint64_t free = 0;
    std::uint64_t available = 0; ///< of `free`, for others than root
};
BOOST_DESCRIBE_STRUCT(file_system, (), (mount, device, type, size, free, available))

/// A disk since the machine started.
struct disk_traffic {
    std::string device;
    std::uint64_t read = 0;    ///< bytes
    std::uint64_t written = 0; ///< bytes
    std::uint64_t busy_ms = 0; ///< how long it had something to do
};
BOOST_DESCRIBE_STRUCT(disk_traffic, (), (device, read, written, busy_ms))

struct disk {
    std::vector<file_system> file_systems;
    std::vector<disk_traffic> disks;
};
BOOST_DESCRIBE_STRUCT(disk, (), (file_systems, disks))

/// Reads /proc/self/mounts: those that are on a device of this machine, each device once, and the root. Their sizes are
/// left.
std::vector<file_system> parse_mounts(std::string_view mounts);
/// Reads /proc/diskstats: whole disks, partitions and such left out where their disk is there, and none that was never
/// used.
std::vector<disk_traffic> parse_disk_traffic(std::string_view diskstats);

disk read_disk();

} // namespace sysinfo
