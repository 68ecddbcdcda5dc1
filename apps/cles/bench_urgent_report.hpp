// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "bench_latency.hpp"

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// What small requests take beside large ones to the same node. All times are in microseconds.
namespace tool {

struct urgent_report {
    std::string bench = "urgent";
    std::string transport{};
    std::string style{};
    std::size_t rounds = 0;
    std::uint64_t requests = 0; ///< small ones, in each pass
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    std::size_t large_bytes = 0;
    std::size_t large_in_flight = 0;
    int client_core = 0;
    int server_core = 0;
    latency_figures idle{};
    latency_figures in_turn{}; ///< beside the large ones
    latency_figures urgent{};  ///< beside the large ones
};
BOOST_DESCRIBE_STRUCT(urgent_report, (),
                      (bench, transport, style, rounds, requests, busy_poll_us, wake_within_us, large_bytes,
                       large_in_flight, client_core, server_core, idle, in_turn, urgent))

std::string table_of(const urgent_report& report);

} // namespace tool
