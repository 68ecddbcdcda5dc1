// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/latency_recorder.hpp"

#include <boost/describe/class.hpp>

#include <vector>

namespace tool {

struct latency_figures {
    double p50_us = 0;
    double p99_us = 0;
    double p999_us = 0;
    double max_us = 0;
};
BOOST_DESCRIBE_STRUCT(latency_figures, (), (p50_us, p99_us, p999_us, max_us))

latency_figures to_figures(const cles::perf::latencies& found);
latency_figures median_of(const std::vector<latency_figures>& passes);

} // namespace tool
