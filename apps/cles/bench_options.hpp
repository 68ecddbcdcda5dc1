// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>

#include "perf/support/handler_style.hpp"
#include "perf/support/pinning.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tool {

enum class carrier : std::uint8_t { tcp, udp, unix_socket, inproc, multicast };

struct bench_options {
    carrier transport = carrier::tcp;
    cles::perf::handler_style style = cles::perf::handler_style::coroutine;
    std::size_t rounds = 5;
    std::uint64_t requests = 0;                          ///< in a pass; 0: what suits the measurement
    std::optional<std::chrono::milliseconds> duration{}; ///< of a pass, instead
    std::string against{};                               ///< a node that runs already

    std::size_t in_flight = 1;
    cles::run_options how{};                                ///< of both ends
    bool one_core = false;                                  ///< for both ends
    std::optional<std::chrono::microseconds> wake_within{}; ///< asked of the host for all that is measured

    std::vector<std::size_t> binders{1}; ///< one number, but for the fan-out
    std::uint32_t keep = 0;
};

/// The cores that the ends are to run on.
cles::perf::placement places_of(const bench_options& options);

/// How long a pass may take.
std::chrono::nanoseconds limit_of(const bench_options& options);

/// In microseconds.
std::optional<std::int64_t> wake_within_us(const bench_options& options);

/// As in a URL.
const char* to_string(carrier c);
const char* to_string(cles::perf::handler_style s);

/// Where the child is to listen; where updates go by multicast, for all else.
std::string bench_url(carrier c);

} // namespace tool
