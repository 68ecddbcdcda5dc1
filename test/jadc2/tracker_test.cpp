// SPDX-License-Identifier: BSL-1.0
#include "fmv/tracker.hpp"
#include "sgd/random_source.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace tracker {
namespace {

fmv::detection at(double x, double y) { return {.centre = {x, y}, .area = 20}; }

constexpr double frame = 0.04; // s

// This many observations of a target that moves uniformly.
void follow(fmv::tracker& all, int looks, double from, double speed) {
    for (int i = 0; i < looks; ++i) {
        const std::vector seen{at(from + speed * i, 50)};
        all.step(seen, frame);
    }
}

} // namespace
} // namespace tracker

BOOST_AUTO_TEST_SUITE(tracker)

BOOST_AUTO_TEST_CASE(one_that_moves_is_confirmed_after_some_looks) {
    fmv::tracker all;
    follow(all, 5, 20, 2);
    BOOST_TEST(all.confirmed().empty());
    follow(all, 3, 30, 2);
    BOOST_TEST_REQUIRE(all.confirmed().size() == 1U);
    const auto target = all.confirmed().front();
    BOOST_TEST(std::abs(target.at.x - 34) < 0.5);
    BOOST_TEST(std::abs(target.velocity.x * frame - 2) < 0.2);
    BOOST_TEST(std::abs(target.age - 7 * frame) < 1e-9);
    BOOST_TEST(target.missed == 0);
}

BOOST_AUTO_TEST_CASE(what_stands_still_never_is) {
    fmv::tracker all;
    follow(all, 100, 20, 0);
    BOOST_TEST(all.confirmed().empty());
}

BOOST_AUTO_TEST_CASE(scattered_noise_never_is) {
    sgd::random_source chance{3};
    fmv::tracker all;
    std::size_t confirmed = 0;
    for (int i = 0; i < 500; ++i) {
        const std::vector seen{at(chance.below(320), chance.below(240)), at(chance.below(320), chance.below(240))};
        all.step(seen, frame);
        confirmed += all.confirmed().size();
    }
    BOOST_TEST(confirmed == 0U);
}

BOOST_AUTO_TEST_CASE(one_that_is_out_of_sight_for_a_while_is_where_it_was_going_to_be) {
    fmv::tracker all;
    follow(all, 20, 20, 2);
    const auto id = all.confirmed().front().id;
    for (int i = 0; i < 4; ++i) {
        all.step({}, frame);
    }
    BOOST_TEST_REQUIRE(all.confirmed().size() == 1U);
    BOOST_TEST(all.confirmed().front().missed == 4);
    BOOST_TEST(std::abs(all.confirmed().front().at.x - 66) < 1);
    follow(all, 1, 68, 2);
    BOOST_TEST(all.confirmed().front().id == id);
    BOOST_TEST(all.confirmed().front().missed == 0);
    for (int i = 0; i < 7; ++i) {
        all.step({}, frame);
    }
    BOOST_TEST(all.confirmed().empty());
}

BOOST_AUTO_TEST_CASE(frames_that_are_missing_are_time_that_passes) {
    fmv::tracker all;
    follow(all, 20, 20, 2);
    const auto id = all.confirmed().front().id;
    const std::vector seen{at(68, 50)}; // five frames later
    all.step(seen, 5 * frame);
    BOOST_TEST_REQUIRE(all.confirmed().size() == 1U);
    BOOST_TEST(all.confirmed().front().id == id);
    BOOST_TEST(all.confirmed().front().missed == 0);
    BOOST_TEST(std::abs(all.confirmed().front().velocity.x * frame - 2) < 0.1);
}

BOOST_AUTO_TEST_CASE(two_that_pass_each_other_keep_their_numbers) {
    fmv::tracker all;
    for (int i = 0; i < 30; ++i) {
        const std::vector seen{at(20 + 2 * i, 50), at(80 - 2 * i, 58)};
        all.step(seen, frame);
    }
    const auto found = all.confirmed();
    BOOST_TEST_REQUIRE(found.size() == 2U);
    BOOST_TEST(found[0].id < found[1].id);
    BOOST_TEST(std::abs(found[0].at.x - 78) < 1);
    BOOST_TEST(std::abs(found[1].at.x - 22) < 1);
}

BOOST_AUTO_TEST_CASE(what_is_torn_off_a_target_is_not_another) {
    fmv::tracker all;
    for (int i = 0; i < 40; ++i) {
        std::vector seen{at(20 + 2 * i, 50)};
        if (i > 15) {
            seen.push_back(at(24 + 2 * i, 52));
        }
        all.step(seen, frame);
    }
    BOOST_TEST(all.confirmed().size() == 1U);
}

BOOST_AUTO_TEST_CASE(frames_that_are_rarer_have_wider_gates) {
    fmv::tracker all;
    for (int i = 0; i < 12; ++i) { // ten pixels from one to the next
        const std::vector seen{at(20 + 10 * i, 50)};
        all.step(seen, 4 * frame);
    }
    BOOST_TEST_REQUIRE(all.confirmed().size() == 1U);
    BOOST_TEST(std::abs(all.confirmed().front().velocity.x * frame - 2.5) < 0.1);
}

BOOST_AUTO_TEST_CASE(the_deviation_of_a_velocity_is_that_of_many_noisy_tracks) {
    sgd::random_source chance{11};
    double squares = 0;
    double count = 0;
    fmv::tracker all;
    for (int i = 0; i < 1000; ++i) {
        const double noise = 0.4 * std::sqrt(3.0); // so that the standard deviation of a uniform error is 0.4
        const std::vector seen{at(20 + i + noise * chance.within_one(), 50 + noise * chance.within_one())};
        all.step(seen, frame);
        if (i > 100) {
            BOOST_TEST_REQUIRE(all.confirmed().size() == 1U);
            const auto velocity = all.confirmed().front().velocity;
            squares += std::pow(velocity.x - 1 / frame, 2) + std::pow(velocity.y, 2);
            count += 2;
        }
    }
    BOOST_TEST(std::abs(std::sqrt(squares / count) / fmv::tracker::velocity_deviation(frame) - 1) < 0.15);
}

BOOST_AUTO_TEST_SUITE_END()
