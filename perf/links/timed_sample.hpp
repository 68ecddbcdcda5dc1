// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/localization.hpp"

#include <cstdint>

namespace cles::perf {

/// The values in turn, with the host's time as their `utc`, to the microsecond: what the packet is for, so that one way
/// is timed without a byte more on the link. Both ends have one host's clock.
localization timed_sample(std::uint64_t n) noexcept;

/// How long ago such a sample was taken, in microseconds.
/// \throws std::runtime_error where it is none
double age_of(const localization& value);

} // namespace cles::perf
