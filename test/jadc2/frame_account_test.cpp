// SPDX-License-Identifier: BSL-1.0
#include "fmv/frame_account.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <limits>

BOOST_AUTO_TEST_SUITE(frame_account)

BOOST_AUTO_TEST_CASE(frames_between_two_that_have_come_are_missing) {
    fmv::frame_account all;
    BOOST_TEST(all.take(100)); // what came before the first one is not this node's
    BOOST_TEST(all.missing() == 0U);
    BOOST_TEST(all.take(101));
    BOOST_TEST(all.missing() == 0U);
    BOOST_TEST(all.take(105));
    BOOST_TEST(all.missing() == 3U);
    BOOST_TEST(all.take(106));
    BOOST_TEST(all.missing() == 3U);
}

BOOST_AUTO_TEST_CASE(none_counts_twice) {
    fmv::frame_account all;
    BOOST_TEST(all.take(0));
    BOOST_TEST(!all.take(0));
    BOOST_TEST(all.take(2));
    BOOST_TEST(!all.take(1)); // it counts as missing
    BOOST_TEST(all.missing() == 1U);
}

BOOST_AUTO_TEST_CASE(the_largest_number_counts_once_too) {
    constexpr auto largest = std::numeric_limits<std::uint64_t>::max();
    fmv::frame_account all;
    BOOST_TEST(all.take(largest));
    BOOST_TEST(!all.take(largest));
    BOOST_TEST(!all.take(0));
    BOOST_TEST(all.missing() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
