// SPDX-License-Identifier: BSL-1.0
#include "core/update_order.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <limits>

BOOST_AUTO_TEST_SUITE(update_order)

BOOST_AUTO_TEST_CASE(the_first_update_is_news_and_no_gap) {
    cles::core::update_order order;
    const auto first = order.take(0xA, 17);
    BOOST_TEST(first.news);
    BOOST_TEST(first.missed == 0U);
    BOOST_TEST(!first.restarted);
}

BOOST_AUTO_TEST_CASE(the_next_update_is_news_without_a_gap) {
    cles::core::update_order order;
    order.take(0xA, 1);
    const auto next = order.take(0xA, 2);
    BOOST_TEST(next.news);
    BOOST_TEST(next.missed == 0U);
}

BOOST_AUTO_TEST_CASE(a_gap_is_reported_with_how_many) {
    cles::core::update_order order;
    order.take(0xA, 17);
    BOOST_TEST(order.take(0xA, 19).missed == 1U);
    BOOST_TEST(order.take(0xA, 1019).missed == 999U);
    constexpr auto last = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    BOOST_TEST(order.take(0xA, last).missed == last - 1020);
}

BOOST_AUTO_TEST_CASE(an_old_or_repeated_update_is_no_news) {
    cles::core::update_order order;
    order.take(0xA, 17);
    BOOST_TEST(!order.take(0xA, 17).news);
    BOOST_TEST(!order.take(0xA, 16).news);
    BOOST_TEST(!order.take(0xA, 1).news);
    BOOST_TEST(order.take(0xA, 18).missed == 0U); // and what was dropped has changed nothing
}

BOOST_AUTO_TEST_CASE(a_restarted_publisher_is_told_by_its_epoch_and_is_no_gap) {
    cles::core::update_order order;
    order.take(0xA, 500);
    const auto again = order.take(0xB, 3);
    BOOST_TEST(again.news);
    BOOST_TEST(again.restarted);
    BOOST_TEST(again.missed == 0U);
    BOOST_TEST(order.take(0xB, 4).news);
}

BOOST_AUTO_TEST_CASE(what_bears_an_epoch_that_was_left_is_dropped) {
    cles::core::update_order order;
    order.take(0xA, 500);
    order.take(0xB, 1);
    BOOST_TEST(!order.take(0xA, 501).news);
    BOOST_TEST(order.take(0xB, 2).news);
}

BOOST_AUTO_TEST_CASE(the_last_4_epochs_that_were_left_are_remembered) {
    cles::core::update_order order;
    for (std::uint32_t epoch = 1; epoch <= 5; ++epoch) {
        BOOST_TEST(order.take(epoch, 1).news);
    }
    for (std::uint32_t left = 1; left <= 4; ++left) {
        BOOST_TEST(!order.take(left, 1000).news, "epoch " << left);
    }
    BOOST_TEST(order.take(6, 1).news); // leaves 5, and 1 is forgotten
    for (std::uint32_t left = 2; left <= 5; ++left) {
        BOOST_TEST(!order.take(left, 1000).news, "epoch " << left);
    }
    BOOST_TEST(order.take(1, 1).restarted);
}

BOOST_AUTO_TEST_CASE(an_epoch_of_0_is_an_epoch_like_any_other) {
    cles::core::update_order order;
    BOOST_TEST(!order.take(0, 1).restarted);
    BOOST_TEST(order.take(1, 1).restarted);
    BOOST_TEST(!order.take(0, 2).news);
}

BOOST_AUTO_TEST_SUITE_END()
