// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "options.hpp"

#include <string>

/// Each function measures, and returns its report as a table or as JSON.
namespace tool {

/// PULL and the hand-written exchange. They take turns, so that a disturbance of the machine affects both.
std::string measure_pulls(const bench_options& options);

/// UPDATE as fast as all binders accept it, as text and as C++ values in turn.
std::string measure_updates(const bench_options& options);

/// One publisher and several numbers of binders, by CLES and by hand: paced, and as fast as possible.
std::string measure_fan_out(const bench_options& options);

/// What each verb sends with the localization packet, over TCP and UDP, compared with the packed struct.
std::string measure_bytes(const bench_options& options);

/// What requests and replies cost by their length, without sockets, compared with the packed struct.
std::string measure_parsing(const bench_options& options);

/// The tail of PULL's latency on cores that other processes use too, with and without real-time scheduling.
std::string measure_stress(const bench_options& options);

/// Small PULLs while large answers of the same node are in flight: without and with `urgent`.
std::string measure_urgent(const bench_options& options);

} // namespace tool
