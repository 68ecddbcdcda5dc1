// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string_view>

namespace sysinfo {

struct load {
    double busy = 0;       ///< part of the cores' time that was spent working lately, 0 to 1
    double one_minute = 0; ///< threads that ran or could have run (or waited for a disk), averaged over so long
    double five_minutes = 0;
    double fifteen_minutes = 0;
    std::uint64_t running = 0; ///< threads that run or could run now
    std::uint64_t threads = 0;
    unsigned cores = 0;
};
BOOST_DESCRIBE_STRUCT(load, (), (busy, one_minute, five_minutes, fifteen_minutes, running, threads, cores))

/// Reads /proc/loadavg; `busy` and `cores` are left.
load parse_load(std::string_view loadavg);

} // namespace sysinfo
