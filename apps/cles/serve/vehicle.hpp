// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe.hpp>

namespace tool {

/// Where a vehicle is and how it moves: the packet that vehicles of a platoon exchange (paper, section 4.1).
struct localization {
    double utc = 0;          ///< seconds since 1970
    double lat = 0;          ///< degrees
    double lon = 0;          ///< degrees
    double velocity = 0;     ///< m/s
    double acceleration = 0; ///< m/s²
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon, velocity, acceleration))

/// A vehicle on a circular test track, now a little faster and now a little slower. Rounded to what a receiver could
/// tell apart, so that its text is short: milliseconds, 0.1 m, cm/s.
localization vehicle_at(double utc);

} // namespace tool
