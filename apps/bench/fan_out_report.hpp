// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "figures.hpp"

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// What one publisher costs with many binders. All times are in microseconds.
namespace tool {

/// One way, from the publication to the value in the binder's code.
struct paced_figures {
    latency_figures latency{};
    double cpu_us = 0; ///< of both ends, per delivery
    double lost = 0;   ///< share of what was published to each; in the report, of all passes together
};
BOOST_DESCRIBE_STRUCT(paced_figures, (), (latency, cpu_us, lost))

struct flat_out_figures {
    double deliveries_per_s = 0;
    double cpu_us = 0;
    double lost = 0;
};
BOOST_DESCRIBE_STRUCT(flat_out_figures, (), (deliveries_per_s, cpu_us, lost))

/// One exchange with so many binders.
struct fan_out_figures {
    paced_figures paced{};
    flat_out_figures flat_out{};
};
BOOST_DESCRIBE_STRUCT(fan_out_figures, (), (paced, flat_out))

/// CLES divided by the hand-written exchange over the same carrier.
struct fan_out_ratio {
    double p50 = 0;
    double p99 = 0;
    double p999 = 0;
    double max = 0;
    double paced_cpu = 0;
    double deliveries_per_s = 0;
    double flat_out_cpu = 0;
};
BOOST_DESCRIBE_STRUCT(fan_out_ratio, (), (p50, p99, p999, max, paced_cpu, deliveries_per_s, flat_out_cpu))

struct fan_out_row {
    std::size_t binders = 1;
    std::uint64_t paced_updates = 0;    ///< in each pass
    std::uint64_t flat_out_updates = 0; ///< in each pass
    fan_out_figures icd{};
    fan_out_figures cles{};
    fan_out_ratio ratio{};
};
BOOST_DESCRIBE_STRUCT(fan_out_row, (), (binders, paced_updates, flat_out_updates, icd, cles, ratio))

struct fan_out_report {
    std::string bench = "fan_out";
    std::string transport{};
    std::string style{};
    std::size_t rounds = 0;
    std::uint64_t rate_hz = 0; ///< of the paced passes
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    int client_core = 0;
    int server_core = 0;
    std::vector<fan_out_row> rows{};
};
BOOST_DESCRIBE_STRUCT(fan_out_report, (),
                      (bench, transport, style, rounds, rate_hz, busy_poll_us, wake_within_us, client_core, server_core,
                       rows))

fan_out_figures median_of(const std::vector<fan_out_figures>& passes);
fan_out_ratio ratio_of(const fan_out_figures& cles, const fan_out_figures& icd);

std::string table_of(const fan_out_report& report);

} // namespace tool
