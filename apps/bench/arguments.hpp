// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "options/keys_option.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

/// The command line of `cles bench`. Both `cles`, for its help and completion, and `cles-bench` are compiled with it.
namespace tool {

enum class measurement : std::uint8_t { pulls, updates, fan_out, stress, urgent, bytes, parse };

enum class carrier : std::uint8_t { tcp, udp, unix_socket, inproc, multicast };

/// The options as given.
struct bench_arguments {
    std::string transport = "tcp";
    std::string style = "coroutine";
    std::size_t rounds = 5;
    std::uint64_t requests = 0;
    std::string duration{};
    std::string against{};
    keys_option keys{};
    std::size_t in_flight = 1;
    std::chrono::microseconds busy_poll{0};
    std::optional<std::chrono::microseconds> wake_within{};
    bool one_core = false;
    std::vector<std::size_t> binders{};
    std::uint32_t keep = 0;
    std::string form = "table";
};

/// Adds description, examples and options to the command.
void add_bench_arguments(CLI::App& command, bench_arguments& given);

/// What the options select. \throws usage_error for options that exclude each other
measurement selected_measurement(const CLI::App& command, const bench_arguments& given);

/// \pre `name` is one of those that --transport accepts
carrier carrier_of(const std::string& name);

} // namespace tool
