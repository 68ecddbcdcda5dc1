// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/localization.hpp"

#include <cstdint>

namespace cles::perf {

/// The nth sample, with the host's time as its `utc`, to the microsecond. So one way can be timed without additional
/// bytes on the link, because both ends read the clock of the same host.
localization timed_sample(std::uint64_t n) noexcept;

/// The age of such a sample in microseconds.
/// \throws std::runtime_error if it is not one
double age_of(const localization& value);

} // namespace cles::perf
