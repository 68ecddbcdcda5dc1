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

/// The values that every server gives out, in turn. They vary, so that no server can keep an answer ready, and are
/// rounded as those of a node that thinks of its readers.
const localization& sample(std::uint64_t n) noexcept;

/// Whether this came through unharmed: what a client checks of each answer.
bool is_sample(const localization& value) noexcept;

} // namespace cles::perf
