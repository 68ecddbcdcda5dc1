// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "fmv/messages.hpp"

namespace jadc2 {

/// What the reconnaissance aircraft publishes as `tracks`. Here places are pixels of the ground, velocities pixels per
/// second, points in time seconds since 1970 by its clock.
struct picture {
    std::string by{};      ///< the node that processed the frame; empty if there is none
    std::string trouble{}; ///< why there is none
    std::uint64_t frame = 0;
    bool ready = false; ///< as in `fmv::found`
    double captured = 0;
    double published = 0;
    double encode_ms = 0; ///< from capture until the frame was sent
    double way_ms = 0;    ///< there and back: the time until the answer without queue and run
    double queue_ms = 0;  ///< at the node
    double run_ms = 0;    ///< at the node
    std::vector<fmv::track> tracks{};
};
BOOST_DESCRIBE_STRUCT(picture, (),
                      (by, trouble, frame, ready, captured, published, encode_ms, way_ms, queue_ms, run_ms, tracks))

/// PUSH recon:impact: where and when something struck. The answer says what is seen of it.
struct impact {
    double x = 0;
    double y = 0;
    double utc = 0;
};
BOOST_DESCRIBE_STRUCT(impact, (), (x, y, utc))

struct assessment {
    double missed_by = 0; ///< pixels to the nearest vehicle's middle
    bool hit = false;     ///< within its size
};
BOOST_DESCRIBE_STRUCT(assessment, (), (missed_by, hit))

} // namespace jadc2
