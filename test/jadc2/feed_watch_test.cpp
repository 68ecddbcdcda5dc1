// SPDX-License-Identifier: BSL-1.0
#include "jadc2/feed_watch.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(feed_watch)

BOOST_AUTO_TEST_CASE(silence_is_shown_after_its_time_and_then_once_per_second) {
    jadc2::feed_watch feed{1};
    BOOST_TEST(!feed.shows_silence(50)); // nothing has come yet
    BOOST_TEST(!feed.heard(100));
    BOOST_TEST(!feed.shows_silence(100.9));
    BOOST_TEST(feed.shows_silence(101));
    BOOST_TEST(feed.silence(101) == 1);
    BOOST_TEST(!feed.shows_silence(101.5));
    BOOST_TEST(feed.shows_silence(102.1));
    BOOST_TEST(feed.heard(102.2)); // it was silent
    BOOST_TEST(!feed.heard(102.3));
    BOOST_TEST(!feed.shows_silence(103.2));
    BOOST_TEST(feed.shows_silence(103.3));
}

BOOST_AUTO_TEST_CASE(one_that_has_ended_is_not_silent) {
    jadc2::feed_watch feed{1};
    feed.heard(100);
    feed.ended();
    BOOST_TEST(!feed.shows_silence(200));
    BOOST_TEST(!feed.heard(201));
    BOOST_TEST(feed.shows_silence(202));
}

BOOST_AUTO_TEST_SUITE_END()
