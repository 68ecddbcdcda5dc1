// SPDX-License-Identifier: BSL-1.0
#include "node/publish/subscription.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <limits>

BOOST_AUTO_TEST_SUITE(sequence_tracker)

BOOST_AUTO_TEST_CASE(the_first_update_is_new_without_a_gap) {
    cles::core::sequence_tracker order;
    const auto first = order.take(0xA, 17);
    BOOST_REQUIRE(first.has_value());
    BOOST_TEST(*first == 0U);
}

BOOST_AUTO_TEST_CASE(the_next_update_is_new_without_a_gap) {
    cles::core::sequence_tracker order;
    order.take(0xA, 1);
    const auto next = order.take(0xA, 2);
    BOOST_REQUIRE(next.has_value());
    BOOST_TEST(*next == 0U);
}

BOOST_AUTO_TEST_CASE(a_gap_is_reported_with_its_size) {
    cles::core::sequence_tracker order;
    order.take(0xA, 17);
    BOOST_TEST(order.take(0xA, 19).value() == 1U);
    BOOST_TEST(order.take(0xA, 1019).value() == 999U);
    constexpr auto last = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    BOOST_TEST(order.take(0xA, last).value() == last - 1020);
}

BOOST_AUTO_TEST_CASE(an_old_or_repeated_update_is_not_new) {
    cles::core::sequence_tracker order;
    order.take(0xA, 17);
    BOOST_TEST(!order.take(0xA, 17).has_value());
    BOOST_TEST(!order.take(0xA, 16).has_value());
    BOOST_TEST(!order.take(0xA, 1).has_value());
    BOOST_TEST(order.take(0xA, 18).value() == 0U); // what was dropped has changed nothing
}

BOOST_AUTO_TEST_CASE(a_new_epoch_is_a_restart_and_not_a_gap) {
    cles::core::sequence_tracker order;
    order.take(0xA, 500);
    const auto again = order.take(0xB, 3);
    BOOST_REQUIRE(again.has_value());
    BOOST_TEST(*again == 0U);
    BOOST_TEST(order.take(0xB, 4).has_value());
}

BOOST_AUTO_TEST_CASE(updates_of_a_previous_epoch_are_dropped) {
    cles::core::sequence_tracker order;
    order.take(0xA, 500);
    order.take(0xB, 1);
    BOOST_TEST(!order.take(0xA, 501).has_value());
    BOOST_TEST(order.take(0xB, 2).has_value());
}

BOOST_AUTO_TEST_CASE(the_last_4_previous_epochs_are_remembered) {
    cles::core::sequence_tracker order;
    for (std::uint32_t epoch = 1; epoch <= 5; ++epoch) {
        BOOST_TEST(order.take(epoch, 1).has_value());
    }
    for (std::uint32_t left = 1; left <= 4; ++left) {
        BOOST_TEST(!order.take(left, 1000).has_value(), "epoch " << left);
    }
    BOOST_TEST(order.take(6, 1).has_value()); // replaces 5, and 1 is forgotten
    for (std::uint32_t left = 2; left <= 5; ++left) {
        BOOST_TEST(!order.take(left, 1000).has_value(), "epoch " << left);
    }
    BOOST_TEST(order.take(1, 1).has_value());
}

BOOST_AUTO_TEST_CASE(epoch_0_is_valid) {
    cles::core::sequence_tracker order;
    BOOST_TEST(order.take(0, 1).has_value());
    BOOST_TEST(order.take(1, 1).has_value());
    BOOST_TEST(!order.take(0, 2).has_value());
}

BOOST_AUTO_TEST_SUITE_END()
