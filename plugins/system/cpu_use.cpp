// SPDX-License-Identifier: BSL-1.0
#include "cpu_use.hpp"

#include "fields.hpp"

namespace sysinfo {

// cpu  user nice system idle iowait irq softirq steal guest guest_nice; user and nice hold the guests' already.
cpu_times parse_cpu_times(std::string_view stat) {
    std::string_view line;
    cpu_times out;
    if (!next_line(stat, line)) {
        return out;
    }
    fields f{line};
    f.next();
    const auto user = f.number<std::uint64_t>();
    const auto nice = f.number<std::uint64_t>();
    const auto system = f.number<std::uint64_t>();
    const auto idle = f.number<std::uint64_t>();
    const auto waiting = f.number<std::uint64_t>();
    const auto interrupts = f.number<std::uint64_t>();
    const auto soft_interrupts = f.number<std::uint64_t>();
    const auto steal = f.number<std::uint64_t>();
    out.busy = user + nice + system + interrupts + soft_interrupts + steal;
    out.all = out.busy + idle + waiting;
    return out;
}

double cpu_use::take(const cpu_times& reading, cles::time_point now) {
    if (now - last_.at >= shortest) {
        before_ = last_;
        last_ = {reading, now};
    }
    const auto all = reading.all - before_.times.all;
    const auto busy = reading.busy - before_.times.busy;
    // Some kernels let single counters go back a little.
    return all == 0 || busy > all ? 0 : static_cast<double>(busy) / static_cast<double>(all);
}

} // namespace sysinfo
