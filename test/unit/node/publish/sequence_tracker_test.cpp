// SPDX-License-Identifier: BSL-1.0
#include "node/publish/subscription.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <limits>

BOOST_AUTO_TEST_SUITE(sequence_tracker)

BOOST_AUTO_TEST_CASE(the_first_update_is_new_without_a_gap) {
    cles::core::sequence_tracker order;
    const auto first = order.take(0xA, 17);
    BOOST_TEST(first.is_new);
    BOOST_TEST(first.missed == 0U);
    BOOST_TEST(!first.restarted);
}

BOOST_AUTO_TEST_CASE(the_next_update_is_new_without_a_gap) {
    cles::core::sequence_tracker order;
    order.take(0xA, 1);
    const auto next = order.take(0xA, 2);
    BOOST_TEST(next.is_new);
    BOOST_TEST(next.missed == 0U);
}

BOOST_AUTO_TEST_CASE(a_gap_is_reported_with_its_size) {
    cles::core::sequence_tracker order;
    order.take(0xA, 17);
    BOOST_TEST(order.take(0xA, 19).missed == 1U);
    BOOST_TEST(order.take(0xA, 1019).missed == 999U);
    constexpr auto last = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    BOOST_TEST(order.take(0xA, last).missed == last - 1020);
}

BOOST_AUTO_TEST_CASE(an_old_or_repeated_update_is_not_new) {
    cles::core::sequence_tracker order;
    order.take(0xA, 17);
    BOOST_TEST(!order.take(0xA, 17).is_new);
    BOOST_TEST(!order.take(0xA, 16).is_new);
    BOOST_TEST(!order.take(0xA, 1).is_new);
    BOOST_TEST(order.take(0xA, 18).missed == 0U); // what was dropped has changed nothing
}

BOOST_AUTO_TEST_CASE(a_new_epoch_is_a_restart_and_not_a_gap) {
    cles::core::sequence_tracker order;
    order.take(0xA, 500);
    const auto again = order.take(0xB, 3);
    BOOST_TEST(again.is_new);
    BOOST_TEST(again.restarted);
    BOOST_TEST(again.missed == 0U);
    BOOST_TEST(order.take(0xB, 4).is_new);
}

BOOST_AUTO_TEST_CASE(updates_of_a_previous_epoch_are_dropped) {
    cles::core::sequence_tracker order;
    order.take(0xA, 500);
    order.take(0xB, 1);
    BOOST_TEST(!order.take(0xA, 501).is_new);
    BOOST_TEST(order.take(0xB, 2).is_new);
}

BOOST_AUTO_TEST_CASE(the_last_4_previous_epochs_are_remembered) {
    cles::core::sequence_tracker order;
    for (std::uint32_t epoch = 1; epoch <= 5; ++epoch) {
        BOOST_TEST(order.take(epoch, 1).is_new);
    }
    for (std::uint32_t left = 1; left <= 4; ++left) {
        BOOST_TEST(!order.take(left, 1000).is_new, "epoch " << left);
    }
    BOOST_TEST(order.take(6, 1).is_new); // replaces 5, and 1 is forgotten
    for (std::uint32_t left = 2; left <= 5; ++left) {
        BOOST_TEST(!order.take(left, 1000).is_new, "epoch " << left);
    }
    BOOST_TEST(order.take(1, 1).restarted);
}

BOOST_AUTO_TEST_CASE(epoch_0_is_valid) {
    cles::core::sequence_tracker order;
    BOOST_TEST(!order.take(0, 1).restarted);
    BOOST_TEST(order.take(1, 1).restarted);
    BOOST_TEST(!order.take(0, 2).is_new);
}

BOOST_AUTO_TEST_SUITE_END()
