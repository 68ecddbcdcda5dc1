// SPDX-License-Identifier: BSL-1.0
#include "jadc2/scene.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

BOOST_AUTO_TEST_SUITE(scene)

BOOST_AUTO_TEST_CASE(a_seed_gives_the_same_film_again) {
    const jadc2::scene one{7};
    const jadc2::scene same{7};
    const jadc2::scene other{8};
    BOOST_TEST((one.frame(3) == same.frame(3)));
    BOOST_TEST((one.frame(3) != one.frame(4)));
    BOOST_TEST((one.frame(3) != other.frame(3)));
    BOOST_TEST(one.frame(0).size() == jadc2::scene::size.pixels());
}

BOOST_AUTO_TEST_CASE(vehicles_move_evenly_and_stay_in_the_picture) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        const jadc2::scene ground{seed};
        auto before = ground.truth(0);
        BOOST_TEST(before.size() >= 3U);
        BOOST_TEST(before.size() <= 5U);
        for (int i = 1; i < 500; ++i) {
            const auto now = ground.truth(i);
            for (std::size_t k = 0; k < now.size(); ++k) {
                BOOST_TEST_REQUIRE(std::hypot(now[k].x - before[k].x, now[k].y - before[k].y) < 2.51);
                BOOST_TEST_REQUIRE(now[k].x >= 16);
                BOOST_TEST_REQUIRE(now[k].x <= jadc2::scene::size.width - 16);
                BOOST_TEST_REQUIRE(now[k].y >= 16);
                BOOST_TEST_REQUIRE(now[k].y <= jadc2::scene::size.height - 16);
            }
            before = now;
        }
    }
}

BOOST_AUTO_TEST_CASE(the_noise_is_as_strong_as_it_says) {
    const jadc2::scene ground{2};
    const auto one = ground.frame(10);
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
