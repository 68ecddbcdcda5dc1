// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>

namespace cles::perf {

/// The data that vehicles of a platoon exchange, and the packet that both exchanges carry.
struct localization {
    double utc = 0;
    double lat = 0;
    double lon = 0;
    double velocity = 0;
    double acceleration = 0;

    bool operator==(const localization&) const = default;
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon, velocity, acceleration))

/// The nth values that every server returns. They vary, so that no server can cache an answer, and are rounded as a
/// user would round them.
const localization& sample(std::uint64_t n) noexcept;

/// Such values with all their digits, as a computation yields them: as text they are longer.
const localization& unrounded_sample(std::uint64_t n) noexcept;

/// Whether these are the values of a sample, which a client checks for each answer.
bool is_sample(const localization& value) noexcept;

} // namespace cles::perf
