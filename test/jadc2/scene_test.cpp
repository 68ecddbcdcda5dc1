// SPDX-License-Identifier: BSL-1.0
#include "jadc2/scene.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

CLES_TEST_SUITE(scene)

BOOST_AUTO_TEST_CASE(a_seed_gives_the_same_film_again) {
    const jadc2::scene one{7};
    const jadc2::scene same{7};
    const jadc2::scene other{8};
    BOOST_TEST((one.frame(3, 50) == same.frame(3, 50)));
    BOOST_TEST((one.frame(3, 50) != one.frame(4, 50)));
    BOOST_TEST((one.frame(3, 50) != other.frame(3, 50)));
    BOOST_TEST((one.frame(3, 50) != one.frame(3, 50.2)));
    BOOST_TEST(one.frame(0, 50).size() == jadc2::scene::size.pixels());
}

BOOST_AUTO_TEST_CASE(vehicles_keep_their_roads_and_nearly_their_speed) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        const jadc2::scene ground{seed};
        constexpr double begin = 1'700'000'000;
        auto before = ground.truth(begin);
        BOOST_TEST(before.size() == 10U);
        for (int i = 1; i < 500; ++i) {
            const auto now = ground.truth(begin + 0.04 * i);
            for (std::size_t k = 0; k < now.size(); ++k) {
                const double east = now[k].at.east - before[k].at.east;
                const double north = now[k].at.north - before[k].at.north;
                if (std::hypot(east, north) > 300) { // it starts again at the other end of its road
                    BOOST_TEST_REQUIRE(std::hypot(before[k].at.east, before[k].at.north) > 199);
                    continue;
                }
                BOOST_TEST_REQUIRE(
                    std::hypot(east - 0.04 * now[k].velocity.east, north - 0.04 * now[k].velocity.north) < 0.001);
                const double speed = std::hypot(now[k].velocity.east, now[k].velocity.north);
                BOOST_TEST_REQUIRE(speed > 11);
                BOOST_TEST_REQUIRE(speed < 21);
                for (std::size_t other = 0; other < k; ++other) {
                    BOOST_TEST_REQUIRE(
                        std::hypot(now[k].at.east - now[other].at.east, now[k].at.north - now[other].at.north) > 7);
                }
            }
            before = now;
        }
    }
}

BOOST_AUTO_TEST_CASE(the_camera_points_at_the_middle_and_reports_almost_that) {
    double squares = 0;
    double expected = 0;
    constexpr std::uint64_t scenes = 200;
    for (std::uint64_t seed = 1; seed <= scenes; ++seed) {
        const jadc2::scene ground{seed};
        constexpr double utc = 1'700'000'000;
        const geo::image_position middle{.x = 160, .y = 120};
        const auto truth = geo::projection{ground.camera(1, utc)}.to_ground(middle).value();
        BOOST_TEST(std::hypot(truth.east, truth.north) < 1.2); // it shakes
        const auto reported = fmv::to_camera(ground.reported(utc), jadc2::scene::size, jadc2::scene::plane());
        const auto believed = geo::projection{reported}.to_ground(middle).value();
        squares += (believed.east * believed.east + believed.north * believed.north) / 2;
        expected =
            geo::ground_deviation(reported, jadc2::scene::position_sigma, jadc2::scene::pointing_sigma * 0.0174533);
    }
    BOOST_TEST(std::abs(std::sqrt(squares / scenes) / expected - 1) < 0.15);
}

BOOST_AUTO_TEST_CASE(the_noise_is_as_strong_as_it_says) {
    const jadc2::scene ground{2};
    const auto one = ground.frame(10, 50);
    double sum = 0;
    double count = 0;
    for (int y = 20; y < 220; ++y) {
        for (int x = 20; x + 2 < 300; ++x) { // second differences along a row: the ground's are small
            const auto i = jadc2::scene::size.at(x, y);
            const double d = one[i] - 2.0 * one[i + 1] + one[i + 2];
            if (std::abs(d) < 40) {
                sum += d * d;
                ++count;
            }
        }
    }
    const double sigma = std::sqrt(sum / count / 6);
    BOOST_TEST(sigma > jadc2::scene::noise * 0.9);
    BOOST_TEST(sigma < jadc2::scene::noise * 1.2);
}

BOOST_AUTO_TEST_SUITE_END()
