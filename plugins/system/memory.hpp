// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string_view>

namespace sysinfo {

/// All in bytes.
struct memory {
    std::uint64_t total = 0;
    std::uint64_t available = 0; ///< that programs can have without swapping
    std::uint64_t free = 0;      ///< that nothing is in
    std::uint64_t cached = 0;    ///< files' contents, given up when needed
    std::uint64_t buffers = 0;
    std::uint64_t swap_total = 0;
    std::uint64_t swap_free = 0;
};
BOOST_DESCRIBE_STRUCT(memory, (), (total, available, free, cached, buffers, swap_total, swap_free))

/// Reads /proc/meminfo.
memory parse_memory(std::string_view meminfo);

} // namespace sysinfo
