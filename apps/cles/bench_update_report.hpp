// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// What updates cost that nobody may miss. All times are in microseconds.
namespace tool {

struct update_figures {
    double deliveries_per_s = 0;
    double updates_per_s = 0;
    double cpu_us = 0; ///< per delivery
    double cpu_binder_us = 0;
    double cpu_publisher_us = 0;
    std::uint64_t missed = 0; ///< in all passes together
};
BOOST_DESCRIBE_STRUCT(update_figures, (),
                      (deliveries_per_s, updates_per_s, cpu_us, cpu_binder_us, cpu_publisher_us, missed))

struct update_report {
    std::string bench = "updates";
    std::string transport{};
    std::string style{};
    std::size_t binders = 1;
    std::size_t rounds = 0;
    std::uint64_t updates = 0; ///< published in each pass
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    int client_core = 0;
    int server_core = 0;
    std::optional<double> update_bytes{};
    update_figures raw{};
    update_figures typed{};
};
BOOST_DESCRIBE_STRUCT(update_report, (),
                      (bench, transport, style, binders, rounds, updates, busy_poll_us, wake_within_us, client_core,
                       server_core, update_bytes, raw, typed))

update_figures median_of(const std::vector<update_figures>& passes);

std::string table_of(const update_report& report);

} // namespace tool
