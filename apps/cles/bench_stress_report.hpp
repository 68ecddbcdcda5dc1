// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "bench_latency.hpp"

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// How steady PULL is while others want the cores. All times are in microseconds.
namespace tool {

struct stress_report {
    std::string bench = "stress";
    std::string transport{};
    std::string style{};
    std::size_t rounds = 0;
    std::uint64_t requests = 0; ///< in each pass
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    std::size_t processes = 0;                    ///< that want the cores too
    int client_core = 0;
    int server_core = 0;
    latency_figures idle{};
    std::optional<latency_figures> idle_fifo{}; ///< nothing where the system does not let us
    latency_figures loaded{};
    std::optional<latency_figures> loaded_fifo{};
};
BOOST_DESCRIBE_STRUCT(stress_report, (),
                      (bench, transport, style, rounds, requests, busy_poll_us, wake_within_us, processes, client_core,
                       server_core, idle, idle_fifo, loaded, loaded_fifo))

std::string table_of(const stress_report& report);

} // namespace tool
