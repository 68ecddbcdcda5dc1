// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "geo/tangent_plane.hpp"
#include "geo/traffic.hpp"
#include "strike/order.hpp"

namespace jadc2::test {

/// An order against a vehicle of the traffic, by a track that is off by an error.
inline strike::order order_for(const geo::traffic::motion& target, double utc, geo::plane_position off = {}) {
    const auto at = geo::tangent_plane{geo::traffic::origin}.to_geographic(
        {.east = target.at.east + off.east, .north = target.at.north + off.north});
    return {.id = "o1",
            .lat = at.lat,
            .lon = at.lon,
            .ve = target.velocity.east,
            .vn = target.velocity.north,
            .sigma = 3,
            .sigma_v = 1,
            .utc = utc};
}

} // namespace jadc2::test
