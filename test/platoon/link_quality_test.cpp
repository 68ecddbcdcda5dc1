// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/link_quality.hpp"
#include "platoon/driver/random_source.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace link_quality {
namespace {

/// A link with ten updates a second, of which those arrive that the test lets through.
struct link {
    platoon::link_quality quality{0};
    int steps = 0; ///< of 10 ms

    template <class Arrives>
    void run(double seconds, const Arrives& arrives) {
        for (const int end = steps + static_cast<int>(std::lround(seconds * 100)); steps < end; ++steps) {
            const double now = steps * 0.01;
            if (steps % 10 == 0 && arrives()) {
                quality.receive(now);
            }
            quality.step(now);
        }
    }
    void lose(double seconds) {
        run(seconds, [] { return false; });
    }
    void receive(double seconds) {
        run(seconds, [] { return true; });
    }
};

} // namespace
} // namespace link_quality

BOOST_AUTO_TEST_SUITE(link_quality)

BOOST_AUTO_TEST_CASE(ten_percent_lost_independently_are_not_poor) {
    link some;
    platoon::random_source random{3};
    for (int i = 0; i < 1000; ++i) {
        some.run(1, [&] { return random.uniform() >= 0.1; });
        BOOST_TEST_REQUIRE(!some.quality.is_poor(), i);
    }
    BOOST_TEST(some.quality.gap_share() == 0);
}

BOOST_AUTO_TEST_CASE(one_silence_has_to_be_long_to_count) {
    link some;
    some.receive(20);
    BOOST_TEST(some.quality.silence() == 0);
    some.lose(1);
    BOOST_TEST(some.quality.silence() > 0.5);
    BOOST_TEST(!some.quality.is_poor());
    BOOST_TEST(some.quality.gap_share() == 0);
    some.receive(20);
    some.lose(1.3);
    BOOST_TEST(some.quality.is_poor());
    BOOST_TEST(some.quality.gap_share() > 0.6);
    BOOST_TEST(some.quality.gap_share() < 0.9);
    some.receive(5);
    BOOST_TEST(some.quality.is_poor()); // not good again at once
    some.receive(10);
    BOOST_TEST(!some.quality.is_poor());
    BOOST_TEST(some.quality.gap_share() == 0);
}

BOOST_AUTO_TEST_CASE(several_short_ones_count_together) {
    link some;
    some.receive(3);
    for (int i = 0; i < 6; ++i) {
        BOOST_TEST(!some.quality.is_poor(), i);
        some.lose(0.4);
        some.receive(0.5);
    }
    BOOST_TEST(some.quality.is_poor());
    BOOST_TEST(some.quality.gap_share() < 0.7);
}

BOOST_AUTO_TEST_CASE(a_link_on_which_nothing_arrives_requires_the_full_gap_but_not_for_ever) {
    link some;
    some.lose(60);
    BOOST_TEST(some.quality.gap_share() > 0.99);
    some.receive(8);
    BOOST_TEST(some.quality.is_poor());
    some.receive(5);
    BOOST_TEST(!some.quality.is_poor());
}

BOOST_AUTO_TEST_SUITE_END()
