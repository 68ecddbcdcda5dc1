// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>

namespace cles::perf {

/// Sleeps until the host's monotonic clock, which `monotonic_ns` reads, shows this. What is past is not waited for.
void wait_until(std::int64_t monotonic_ns);

} // namespace cles::perf
