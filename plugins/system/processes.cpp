// SPDX-License-Identifier: BSL-1.0
#include "processes.hpp"

#include <cles/error.hpp>

#include "fields.hpp"
#include "kernel_file.hpp"

#include <algorithm>
#include <memory>

#include <dirent.h>
#include <unistd.h>

namespace sysinfo {
namespace {

constexpr std::size_t most_processes = 65536;

} // namespace

// 42 (a name (with) spaces) S 1 42 42 0 -1 4194560 ... : what follows the last bracket has a fixed order.
std::optional<process> parse_process(std::string_view stat, const kernel_units& units) {
    const auto open = stat.find('(');
    const auto close = stat.rfind(')');
    if (open == std::string_view::npos || close == std::string_view::npos || close < open) {
        return std::nullopt;
    }
    process out;
    out.pid = fields{stat.substr(0, open)}.number<std::int64_t>();
    out.name = stat.substr(open + 1, close - open - 1);
    fields f{stat.substr(close + 1)};
    out.state = f.next();
    if (out.state.empty()) {
        return std::nullopt;
    }
    f.skip(10); // ppid ... cmajflt
    const auto user = f.number<std::uint64_t>();
    const auto system = f.number<std::uint64_t>();
    constexpr std::uint64_t milliseconds = 1000;
    out.cpu_ms = (user + system) * milliseconds / units.ticks_per_second;
    f.skip(4); // cutime ... nice
    out.threads = f.number<std::uint64_t>();
    f.skip(3); // itrealvalue starttime vsize
    const auto pages = f.number<std::int64_t>();
    out.memory = pages > 0 ? static_cast<std::uint64_t>(pages) * units.page : 0;
    return out;
}

processes summed_up(std::vector<process> all, std::size_t most_listed) {
    processes out{.count = all.size()};
    for (const auto& p : all) {
        out.threads += p.threads;
    }
    const auto larger = [](const process& a, const process& b) {
        return a.memory != b.memory ? a.memory > b.memory : a.pid < b.pid;
    };
    const auto listed = static_cast<std::ptrdiff_t>(std::min(most_listed, all.size()));
    std::partial_sort(all.begin(), all.begin() + listed, all.end(), larger);
    all.erase(all.begin() + listed, all.end());
    out.largest = std::move(all);
    return out;
}

processes read_processes(std::size_t most_listed) {
    const kernel_units units{.ticks_per_second = static_cast<std::uint64_t>(::sysconf(_SC_CLK_TCK)),
                             .page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE))};
    const std::unique_ptr<DIR, int (*)(DIR*)> proc{::opendir("/proc"), &::closedir};
    if (!proc) {
        throw cles::error(cles::errc::failed, "this kernel does not report its processes");
    }
    std::vector<process> all;
    while (const auto* entry = ::readdir(proc.get())) { // NOLINT(concurrency-mt-unsafe): a DIR of its own
        const std::string_view name{static_cast<const char*>(entry->d_name)};
        if (name.find_first_not_of("0123456789") != std::string_view::npos || all.size() >= most_processes) {
            continue;
        }
        const auto stat = read_if_there(("/proc/" + std::string{name} + "/stat").c_str());
        if (auto found = parse_process(stat, units)) {
            all.push_back(std::move(*found));
        }
    }
    return summed_up(std::move(all), most_listed);
}

} // namespace sysinfo
