// SPDX-License-Identifier: BSL-1.0
#include "memory.hpp"

#include "fields.hpp"

#include <array>
#include <utility>

namespace sysinfo {

// MemTotal:       16384256 kB
memory parse_memory(std::string_view meminfo) {
    memory out;
    const std::array<std::pair<std::string_view, std::uint64_t*>, 7> wanted{{{"MemTotal:", &out.total},
                                                                             {"MemAvailable:", &out.available},
                                                                             {"MemFree:", &out.free},
                                                                             {"Cached:", &out.cached},
                                                                             {"Buffers:", &out.buffers},
                                                                             {"SwapTotal:", &out.swap_total},
                                                                             {"SwapFree:", &out.swap_free}}};
    constexpr std::uint64_t kilobyte = 1024;
    std::string_view line;
    while (next_line(meminfo, line)) {
        fields f{line};
        const auto name = f.next();
        for (const auto& [key, to] : wanted) {
            if (name == key) {
                *to = f.number<std::uint64_t>() * kilobyte;
            }
        }
    }
    return out;
}

} // namespace sysinfo
