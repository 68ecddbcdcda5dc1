// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "bench_bytes_report.hpp"
#include "bench_fan_out_report.hpp"
#include "bench_options.hpp"
#include "bench_parse_report.hpp"
#include "bench_pull_report.hpp"
#include "bench_stress_report.hpp"
#include "bench_update_report.hpp"
#include "bench_urgent_report.hpp"

namespace tool {

/// PULL against the hand-written exchange, in turn, so that what disturbs the machine disturbs both.
pull_report bench_pulls(const bench_options& options);

/// UPDATE as fast as all binders take it, as text and as C++ values in turn.
update_report bench_updates(const bench_options& options);

/// One publisher and several numbers of binders against the same by hand: paced, and as fast as possible.
fan_out_report bench_fan_out(const bench_options& options);

/// What each verb puts on the wire with the localization packet, over TCP and UDP, against the packed struct.
bytes_report bench_bytes(const bench_options& options);

/// What requests and replies cost by their length, without sockets, beside the packed struct.
parse_report bench_parse(const bench_options& options);

/// The tail of PULL's latency while other processes want the same cores, with and without real-time scheduling.
stress_report bench_stress(const bench_options& options);

/// Small PULLs beside large ones to the same node: in their turn, and urgently.
urgent_report bench_urgent(const bench_options& options);

} // namespace tool
