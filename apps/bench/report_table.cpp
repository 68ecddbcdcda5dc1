// SPDX-License-Identifier: BSL-1.0
#include "report_table.hpp"

namespace tool {

std::string fixed(std::optional<double> value, int digits) { return value ? fixed(*value, digits) : "-"; }

std::string times(double ratio) { return fixed(ratio, 2) + "x"; }
std::string times(std::optional<double> ratio) { return ratio ? times(*ratio) : "-"; }

void rows::add(const std::string& name, const latency_figures& figures) {
    add({name, fixed(figures.p50_us, 1), fixed(figures.p99_us, 1), fixed(figures.p999_us, 1),
         fixed(figures.max_us, 1)});
}

void rows::add_ratio(const std::string& name, const latency_figures& of, const latency_figures& to) {
    add({name, times(over(of.p50_us, to.p50_us)), times(over(of.p99_us, to.p99_us)),
         times(over(of.p999_us, to.p999_us)), times(over(of.max_us, to.max_us))});
}

std::string cores(int client, std::optional<int> server) {
    if (!server) {
        return "client on core " + std::to_string(client);
    }
    if (*server == client) {
        return "both ends on core " + std::to_string(client) + ", alternating";
    }
    return "client on core " + std::to_string(client) + ", server on core " + std::to_string(*server);
}

std::string styles(const std::string& style) { return style + (style == "batch" ? "es" : "s"); }

std::string waiting(std::int64_t busy_poll_us, std::optional<std::int64_t> wake_within_us) {
    std::string words;
    if (busy_poll_us != 0) {
        words += ", CLES polling up to " + std::to_string(busy_poll_us) + " us";
    }
    if (wake_within_us) {
        words += *wake_within_us == 0 ? ", cores kept awake"
                                      : ", cores asked to wake within " + std::to_string(*wake_within_us) + " us";
    }
    return words;
}

} // namespace tool
