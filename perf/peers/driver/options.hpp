// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace cles::perf::peers {

enum class mode : std::uint8_t { exchange, task, fan_out };

struct options {
    peers::mode mode = mode::exchange;
    std::string over;            ///< the carrier; empty: the peer's first
    std::uint32_t in_flight = 1; ///< calls at a time
    std::uint32_t count = 2'000; ///< calls, or publications
    std::uint32_t subscribers = 1;
    std::uint32_t interval_us = 1'000; ///< between publications
    bool spread = false;               ///< let all threads of both ends run on all cores
    bool only_about = false;
    bool help = false;
};

extern const char* const usage;

/// \throws std::invalid_argument, with a message for the user
options read_options(std::span<char*> arguments);

} // namespace cles::perf::peers
