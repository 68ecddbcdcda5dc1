// SPDX-License-Identifier: BSL-1.0
#include "core/update_gathering.hpp"

#include <boost/test/unit_test.hpp>

namespace update_gathering {
namespace {

constexpr cles::time_point start{std::chrono::seconds{1}};
constexpr auto longest = cles::core::update_gathering::longest;

} // namespace
} // namespace update_gathering

BOOST_AUTO_TEST_SUITE(update_gathering)

BOOST_AUTO_TEST_CASE(one_alone_goes_at_once) {
    cles::core::update_gathering all;
    BOOST_TEST(!all.waits(1, start));
    all.gone(1, start);
    BOOST_TEST(!all.waits(2, start + longest));
    all.gone(2, start + longest);
    BOOST_TEST(!all.waits(2, start + longest)); // and where there is none, none waits
}

BOOST_AUTO_TEST_CASE(the_first_and_those_that_come_after_a_while_are_alone) {
    cles::core::update_gathering all;
    BOOST_TEST(all.alone(start));
    all.gone(1, start);
    BOOST_TEST(all.alone(start + longest));
    BOOST_TEST(!all.alone(start + longest - std::chrono::nanoseconds{1}));
    all.gone(1, start);
    BOOST_TEST(!all.alone(start));
}

BOOST_AUTO_TEST_CASE(where_several_came_together_the_next_is_not_taken_for_one_alone) {
    constexpr auto cycle = 10 * longest;
    cles::core::update_gathering all;
    all.gone(1, start);
    BOOST_TEST(all.waits(3, start));
    BOOST_TEST(!all.waits(3, start));
    all.gone(3, start); // two behind the first
    BOOST_TEST(!all.alone(start + cycle));
    BOOST_TEST(!all.waits(6, start + cycle)); // they go with the turn
    all.gone(6, start + cycle);
    BOOST_TEST(!all.alone(start + 2 * cycle));
    BOOST_TEST(!all.waits(7, start + 2 * cycle));
    all.gone(7, start + 2 * cycle); // one alone
    BOOST_TEST(all.alone(start + 3 * cycle));
    all.gone(8, start + 3 * cycle);
    BOOST_TEST(!all.alone(start + 3 * cycle + longest / 2)); // one that followed it closely
    all.gone(9, start + 3 * cycle + 2 * longest);            // however late it went
    BOOST_TEST(!all.alone(start + 4 * cycle));
}

BOOST_AUTO_TEST_CASE(behind_others_they_wait_while_each_turn_brings_more) {
    cles::core::update_gathering all;
    all.gone(1, start);
    BOOST_TEST(all.waits(2, start));
    BOOST_TEST(all.waits(3, start));
    BOOST_TEST(!all.waits(3, start));
}

BOOST_AUTO_TEST_CASE(never_for_longer_than_a_moment) {
    cles::core::update_gathering all;
    all.gone(0, start);
    BOOST_TEST(all.waits(1, start));
    BOOST_TEST(all.waits(2, start + longest / 2));
    BOOST_TEST(!all.waits(3, start + longest));
    all.gone(3, start + longest);
    BOOST_TEST(all.waits(4, start + longest));
    BOOST_TEST(!all.waits(5, start + 2 * longest));
}

BOOST_AUTO_TEST_CASE(nor_for_more_than_binders_have_room_for) {
    cles::core::update_gathering all;
    all.gone(100, start);
    BOOST_TEST(all.waits(100 + all.most - 1, start));
    BOOST_TEST(!all.waits(100 + all.most, start));
}

BOOST_AUTO_TEST_SUITE_END()
