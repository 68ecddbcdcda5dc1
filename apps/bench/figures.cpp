// SPDX-License-Identifier: BSL-1.0
#include "figures.hpp"

namespace tool {

latency_figures to_figures(const cles::perf::latencies& found) {
    return {.p50_us = found.p50, .p99_us = found.p99, .p999_us = found.p999, .max_us = found.max};
}

latency_figures median_of(const std::vector<latency_figures>& passes) {
    using figures = latency_figures;
    const medians of{passes};
    return {.p50_us = of(&figures::p50_us),
            .p99_us = of(&figures::p99_us),
            .p999_us = of(&figures::p999_us),
            .max_us = of(&figures::max_us)};
}

} // namespace tool
