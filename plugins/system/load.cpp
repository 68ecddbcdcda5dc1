// SPDX-License-Identifier: BSL-1.0
#include "load.hpp"

#include "fields.hpp"

namespace sysinfo {

// 0.20 0.18 0.12 1/80 11206
load parse_load(std::string_view loadavg) {
    std::string_view line;
    next_line(loadavg, line);
    fields f{line};
    load out;
    out.one_minute = f.number<double>();
    out.five_minutes = f.number<double>();
    out.fifteen_minutes = f.number<double>();
    const auto entities = f.next();
    const auto slash = entities.find('/');
    out.running = fields{entities.substr(0, slash)}.number<std::uint64_t>();
    if (slash != std::string_view::npos) {
        out.threads = fields{entities.substr(slash + 1)}.number<std::uint64_t>();
    }
    return out;
}

} // namespace sysinfo
