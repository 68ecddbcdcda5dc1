// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "fmv/messages.hpp"

#include <optional>
#include <vector>

namespace jadc2 {

/// What the reconnaissance aircraft publishes as `tracks`. Points in time are seconds since 1970 by its clock.
struct picture {
    std::string by{};      ///< the node that processed the frame; empty if there is none
    std::string trouble{}; ///< why there is none
    std::uint64_t frame = 0;
    std::optional<std::uint64_t> missing{}; ///< frames before this one without tracks, since the last picture
    bool ready = false;                     ///< as in `fmv::found`
    double captured = 0;
    double published = 0;
    double encode_ms = 0; ///< from capture until the frame was sent
    double way_ms = 0;    ///< there and back: the time until the answer without queue and run
    double queue_ms = 0;  ///< at the node
    double run_ms = 0;    ///< at the node
    std::vector<fmv::track> tracks{};
    std::optional<std::vector<std::uint64_t>> engaged{}; ///< numbers of tracks that are under attack or hit
};
BOOST_DESCRIBE_STRUCT(picture, (),
                      (by, trouble, frame, missing, ready, captured, published, encode_ms, way_ms, queue_ms, run_ms,
                       tracks, engaged))

/// PUSH recon:impact: where and when something struck, and what it was meant for. The answer says what is seen of it.
struct impact {
    std::string by{};         ///< the node that processed the frame with the track
    std::uint64_t target = 0; ///< the track's number
    double lat = 0;           ///< degrees, WGS 84
    double lon = 0;
    double utc = 0;
};
BOOST_DESCRIBE_STRUCT(impact, (), (by, target, lat, lon, utc))

/// The distance within which a weapon has an effect on a vehicle, m. The camera sees it as ten pixels.
constexpr double effective_radius = 5;

struct assessment {
    double missed_by = 0;   ///< m to the middle of the vehicle
    bool hit = false;       ///< within `effective_radius`
    bool is_target = false; ///< it is the vehicle of that track; else the nearest one, because the track is not known
};
BOOST_DESCRIBE_STRUCT(assessment, (), (missed_by, hit, is_target))

} // namespace jadc2
