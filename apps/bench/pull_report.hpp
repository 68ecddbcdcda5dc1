// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// What PULL costs against the hand-written exchange. All times are in microseconds.
namespace tool {

/// One exchange: of one pass, or the medians over all passes.
struct exchange_figures {
    double p50_us = 0;
    double p99_us = 0;
    double p999_us = 0;
    double max_us = 0;
    double requests_per_s = 0;
    std::optional<double> cpu_us{}; ///< of both ends; nothing where the other end is out of sight
    double cpu_client_us = 0;
    std::optional<double> cpu_server_us{}; ///< nothing where both ends are one process too
    std::optional<double> request_bytes{};
    std::optional<double> reply_bytes{};
};
BOOST_DESCRIBE_STRUCT(exchange_figures, (),
                      (p50_us, p99_us, p999_us, max_us, requests_per_s, cpu_us, cpu_client_us, cpu_server_us,
                       request_bytes, reply_bytes))

/// CLES divided by the hand-written exchange over TCP.
struct exchange_ratio {
    double p50 = 0;
    double p99 = 0;
    double p999 = 0;
    double max = 0;
    double requests_per_s = 0;
    std::optional<double> cpu{};
    std::optional<double> bytes{};
};
BOOST_DESCRIBE_STRUCT(exchange_ratio, (), (p50, p99, p999, max, requests_per_s, cpu, bytes))

struct pull_report {
    std::string bench = "pull";
    std::string transport{};
    std::string style{};
    std::size_t in_flight = 1;
    std::size_t rounds = 0;
    std::uint64_t requests = 0; ///< counted in all passes of CLES together
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    int client_core = 0;
    std::optional<int> server_core{}; ///< nothing where both ends are one process, or the server is none of ours
    std::optional<std::string> against{};
    std::optional<exchange_figures> icd{};      ///< over TCP
    std::optional<exchange_figures> icd_unix{}; ///< beside CLES over a Unix socket
    std::optional<exchange_figures> icd_udp{};  ///< beside CLES over UDP
    exchange_figures cles{};
    std::optional<exchange_ratio> ratio{};
};
BOOST_DESCRIBE_STRUCT(pull_report, (),
                      (bench, transport, style, in_flight, rounds, requests, busy_poll_us, wake_within_us, client_core,
                       server_core, against, icd, icd_unix, icd_udp, cles, ratio))

/// Each figure's median over the passes.
exchange_figures median_of(const std::vector<exchange_figures>& passes);
exchange_ratio ratio_of(const exchange_figures& cles, const exchange_figures& icd);

std::string table_of(const pull_report& report);

} // namespace tool
