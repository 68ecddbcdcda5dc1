// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>

#include "arguments.hpp"
#include "perf/support/handler_style.hpp"
#include "perf/support/pinning.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tool {

/// How to measure.
struct bench_options {
    carrier transport = carrier::tcp;
    cles::perf::handler_style style = cles::perf::handler_style::coroutine;
    std::size_t rounds = 5;
    std::uint64_t requests = 0;                          ///< in a pass; 0: the default of the measurement
    std::optional<std::chrono::milliseconds> duration{}; ///< of a pass, instead
    std::string against{};                               ///< a node that is already running
    std::string keys{};                                  ///< the key directory, if that node has security

    std::size_t in_flight = 1;
    cles::run_options how{};                                ///< of both ends
    bool one_core = false;                                  ///< for both ends
    std::optional<std::chrono::microseconds> wake_within{}; ///< asked of the host for all that is measured

    std::vector<std::size_t> binders{1}; ///< one number, except for the fan-out
    std::uint32_t keep = 0;
    bool as_json = false;
};

/// \throws usage_error for a duration that cannot be read
bench_options to_options(const bench_arguments& given, measurement what);

/// The cores for the two ends.
cles::perf::placement places_of(const bench_options& options);

/// How long a pass may take.
std::chrono::nanoseconds limit_of(const bench_options& options);

/// In microseconds.
std::optional<std::int64_t> wake_within_us(const bench_options& options);

/// As in a URL.
const char* to_string(carrier c);
const char* to_string(cles::perf::handler_style s);

/// Where the child process listens. By multicast only updates are sent, so it is a URL of TCP then.
std::string bench_url(carrier c);

} // namespace tool
