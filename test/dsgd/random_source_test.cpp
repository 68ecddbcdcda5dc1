// SPDX-License-Identifier: BSL-1.0
#include "sgd/random_source.hpp"

#include <boost/test/unit_test.hpp>

#include <array>

BOOST_AUTO_TEST_SUITE(random_source)

// The first numbers from 1234567, as the authors' code produces them.
BOOST_AUTO_TEST_CASE(it_is_splitmix64) {
    sgd::random_source chance{1234567};
    BOOST_TEST(chance.next() == 6457827717110365317U);
    BOOST_TEST(chance.next() == 3203168211198807973U);
    BOOST_TEST(chance.next() == 9817491932198370423U);
}

BOOST_AUTO_TEST_CASE(all_below_the_bound_are_as_likely) {
    sgd::random_source chance{1};
    std::array<int, 7> counts{};
    for (int i = 0; i < 70'000; ++i) {
        ++counts.at(chance.below(7));
    }
    for (const auto count : counts) {
        BOOST_TEST(count > 9'500);
        BOOST_TEST(count < 10'500);
    }
}

BOOST_AUTO_TEST_CASE(the_interval_is_kept) {
    sgd::random_source chance{2};
    double sum = 0;
    for (int i = 0; i < 100'000; ++i) {
        const auto x = chance.within_one();
        BOOST_TEST_REQUIRE((x >= -1 && x < 1));
        sum += x;
    }
    BOOST_TEST(sum / 100'000 < 0.01);
    BOOST_TEST(sum / 100'000 > -0.01);
}

BOOST_AUTO_TEST_SUITE_END()
