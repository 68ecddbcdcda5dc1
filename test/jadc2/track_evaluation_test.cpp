// SPDX-License-Identifier: BSL-1.0
#include "jadc2/track_evaluation.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace track_evaluation {
namespace {

// A track at the place where the aircraft believes what it sees of the ground to be.
fmv::track track_at(const jadc2::scene& ground, geo::plane_position place, geo::plane_position off, std::uint64_t id) {
    const geo::projection truth{ground.camera(0, 0)};
    const geo::projection reported{fmv::to_camera(ground.reported(0), jadc2::scene::size, jadc2::scene::plane())};
    const auto believed = reported.to_ground(truth.to_image(place).value()).value();
    const auto at =
        jadc2::scene::plane().to_geographic({.east = believed.east + off.east, .north = believed.north + off.north});
    return {.id = id, .lat = at.lat, .lon = at.lon};
}

} // namespace
} // namespace track_evaluation

BOOST_AUTO_TEST_SUITE(track_evaluation)

BOOST_AUTO_TEST_CASE(the_error_of_the_reported_camera_does_not_matter_for_recall_but_for_the_place) {
    const jadc2::scene ground{3};
    jadc2::track_evaluation evaluation{ground};
    evaluation.begin(0, 0);
    std::vector<fmv::track> tracks;
    const auto motions = ground.truth(0);
    for (std::size_t i = 0; i < motions.size(); ++i) {
        tracks.push_back(track_at(ground, motions[i].at, {}, i + 1));
    }
    for (int i = 0; i < 12; ++i) { // after ten frames, vehicles have to be found
        evaluation.add(0, tracks, true);
    }
    BOOST_TEST(evaluation.found().sums().frames == 12U);
    BOOST_TEST(evaluation.found().sums().vehicles > 0U);
    BOOST_TEST(evaluation.found().recall() == 1);
    BOOST_TEST(evaluation.found().false_per_frame() == 0);
    BOOST_TEST(evaluation.vehicle_of(2).value() == 1U);
    BOOST_TEST(!evaluation.vehicle_of(99));
    BOOST_TEST(evaluation.place_error() > 0.5);  // of this seed
    BOOST_TEST(evaluation.velocity_error() > 5); // the tracks have none
}

BOOST_AUTO_TEST_CASE(tracks_that_are_off_are_false) {
    const jadc2::scene ground{3};
    jadc2::track_evaluation evaluation{ground};
    evaluation.begin(0, 0);
    const auto off = track_at(ground, ground.truth(0)[0].at, {.east = 5, .north = 0}, 1); // ten pixels
    evaluation.add(0, {off}, true);
    BOOST_TEST(evaluation.found().sums().false_tracks == 1U);
    BOOST_TEST(!evaluation.vehicle_of(1));
    evaluation.add(0, {off}, false); // not scored before the background is known
    BOOST_TEST(evaluation.found().sums().frames == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
