// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>

namespace jadc2 {

struct rehearsal_options {
    std::uint64_t strikes = 100;
    std::uint64_t seed = 1;
    std::uint64_t scans = 30; ///< of the strike aircraft's own sensor, that are fused
    double delay_s = 0.3;     ///< from the frame that shows the target to the release
};

/// How well strikes went.
struct strike_record {
    std::uint64_t strikes = 0;
    std::uint64_t not_aimed = 0; ///< because the target is too fast; the members below are of the others
    std::uint64_t hits = 0;      ///< within `effective_radius` of the vehicle that was meant
    double median_missed_by = 0; ///< m
    double p95_missed_by = 0;    ///< m
    double expected_sigma = 0;   ///< m, per axis, as the aircraft says: root mean square
    double observed_sigma = 0;   ///< m, the same, as it is in truth
};
BOOST_DESCRIBE_STRUCT(strike_record, (),
                      (strikes, not_aimed, hits, median_missed_by, p95_missed_by, expected_sigma, observed_sigma))

/// The same strikes in both ways.
struct rehearsal_result {
    strike_record fused{};       ///< with the plots of the strike aircraft's own sensor
    strike_record track_alone{}; ///< without them
};
BOOST_DESCRIBE_STRUCT(rehearsal_result, (), (fused, track_alone))

/// Strikes against targets in scenes from that seed on, at most three in each: from frames to tracks, from a track to
/// the fused aim, to the vehicle at the time of the impact. It uses the algorithms of the plugins, simulated time and
/// no network. \throws std::runtime_error if there are too few targets in the scenes
rehearsal_result rehearse(const rehearsal_options& args);

/// Prints it as JSON. \return the exit code
int print_rehearsal(const rehearsal_options& args);

} // namespace jadc2
