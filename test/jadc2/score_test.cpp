// SPDX-License-Identifier: BSL-1.0
#include "jadc2/score.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(score)

BOOST_AUTO_TEST_CASE(of_nothing_there_is_nothing_to_say) {
    const jadc2::score s;
    BOOST_TEST(s.recall() == 0);
    BOOST_TEST(s.false_per_frame() == 0);
}

BOOST_AUTO_TEST_CASE(each_vehicle_has_one_track_and_the_rest_are_false) {
    jadc2::score s;
    const auto vehicles =
        s.add({{{10, 10}, true}, {{50, 50}, true}}, {{11, 10}, {13, 10}, {200, 200}}); // two on the first
    BOOST_TEST(vehicles[0].value() == 0U);
    BOOST_TEST(!vehicles[1]);
    BOOST_TEST(s.sums().vehicles == 2U);
    BOOST_TEST(s.sums().found == 1U);
    BOOST_TEST(s.sums().false_tracks == 2U);
    s.add({{{10, 10}, true}}, {{10, 10}});
    BOOST_TEST(s.recall() == 2.0 / 3);
    BOOST_TEST(s.false_per_frame() == 1);
}

BOOST_AUTO_TEST_CASE(the_nearest_pair_comes_first) {
    jadc2::score s;
    s.add({{{10, 10}, true}, {{14, 10}, true}},
          {{13, 10}, {18, 10}}); // the first track is nearer to the second vehicle
    BOOST_TEST(s.sums().found == 1U);
    BOOST_TEST(s.sums().false_tracks == 1U);
}

BOOST_AUTO_TEST_CASE(what_is_too_far_off_is_false) {
    jadc2::score s;
    s.add({{{10, 10}, true}}, {{10, 10 + jadc2::score::near + 0.1}});
    BOOST_TEST(s.sums().found == 0U);
    BOOST_TEST(s.sums().false_tracks == 1U);
}

BOOST_AUTO_TEST_CASE(one_that_has_just_come_into_sight_may_be_found_but_need_not) {
    jadc2::score s;
    s.add({{{10, 10}, false}, {{50, 50}, true}}, {{10, 10}, {50, 50}});
    s.add({{{10, 10}, false}, {{50, 50}, true}}, {{50, 50}});
    BOOST_TEST(s.sums().vehicles == 2U);
    BOOST_TEST(s.recall() == 1);
    BOOST_TEST(s.false_per_frame() == 0);
}

BOOST_AUTO_TEST_SUITE_END()
