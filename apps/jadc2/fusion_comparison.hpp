// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>

namespace jadc2 {

struct comparison_options {
    std::uint64_t scenes = 20;
    std::uint64_t seed = 1;
    double seconds = 6; ///< of the film of each
};

/// How accurate the places of tracks are: standard deviations, m, per axis.
struct place_record {
    double expected_sigma = 0; ///< as the node says
    double observed_sigma = 0; ///< as it is in truth
};
BOOST_DESCRIBE_STRUCT(place_record, (), (expected_sigma, observed_sigma))

/// The same tracks from one source and from two, in the last second of each film.
struct comparison_result {
    std::uint64_t scenes = 0;    ///< that had targets then
    std::uint64_t fused = 0;     ///< of these, those where plots were fused in the end
    place_record camera_alone{}; ///< one source
    place_record with_plots{};   ///< two: fused with the plots of the satellite's radar
};
BOOST_DESCRIBE_STRUCT(comparison_result, (), (scenes, fused, camera_alone, with_plots))

/// Films scenes from that seed on, and compares their tracks with the truth. It uses the algorithms of the plugin,
/// simulated time and no network.
comparison_result compare_sources(const comparison_options& args);

/// Prints it as JSON. \return the exit code
int print_comparison(const comparison_options& args);

} // namespace jadc2
