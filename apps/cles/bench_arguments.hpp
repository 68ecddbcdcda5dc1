// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "bench_options.hpp"

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

/// What `cles bench` can measure.
enum class measurement : std::uint8_t { pulls, updates, fan_out, stress, urgent, bytes, parse };

/// The command line as it was given.
struct bench_arguments {
    bench_options options{};
    measurement what = measurement::pulls;
    std::string transport = "tcp";
    std::string style = "coroutine";
    std::string duration{};
    std::string form = "table";
    std::vector<std::size_t> binders{};
    int busy_poll_us = 0;
    std::optional<int> wake_within_us{};
};

/// Adds the options to the command.
void add_bench_arguments(CLI::App& command, bench_arguments& given);

/// Fills in what is measured and how. \throws usage_error for what does not go together
void settle(const CLI::App& command, bench_arguments& given);

} // namespace tool
