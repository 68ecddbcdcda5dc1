// SPDX-License-Identifier: BSL-1.0
#include "node/flush_scheduler.hpp"

#include <boost/test/unit_test.hpp>

namespace update_coalescer {
namespace {

constexpr cles::time_point start{std::chrono::seconds{1}};
constexpr auto longest = cles::core::update_coalescer::longest;

} // namespace
} // namespace update_coalescer

BOOST_AUTO_TEST_SUITE(update_coalescer)

BOOST_AUTO_TEST_CASE(a_single_update_is_sent_at_once) {
    cles::core::update_coalescer all;
    BOOST_TEST(!all.waits(1, start));
    all.gone(1, start);
    BOOST_TEST(!all.waits(2, start + longest));
    all.gone(2, start + longest);
    BOOST_TEST(!all.waits(2, start + longest)); // without an update nothing waits
}

BOOST_AUTO_TEST_CASE(the_first_and_those_after_a_pause_are_single) {
    cles::core::update_coalescer all;
    BOOST_TEST(all.alone(start));
    all.gone(1, start);
    BOOST_TEST(all.alone(start + longest));
    BOOST_TEST(!all.alone(start + longest - std::chrono::nanoseconds{1}));
    all.gone(1, start);
    BOOST_TEST(!all.alone(start));
}

BOOST_AUTO_TEST_CASE(after_several_updates_the_next_does_not_count_as_single) {
    constexpr auto cycle = 10 * longest;
    cles::core::update_coalescer all;
    all.gone(1, start);
    BOOST_TEST(all.waits(3, start));
    BOOST_TEST(!all.waits(3, start));
    all.gone(3, start); // two after the first
    BOOST_TEST(!all.alone(start + cycle));
    BOOST_TEST(!all.waits(6, start + cycle)); // they leave in one turn
    all.gone(6, start + cycle);
    BOOST_TEST(!all.alone(start + 2 * cycle));
    BOOST_TEST(!all.waits(7, start + 2 * cycle));
    all.gone(7, start + 2 * cycle); // a single one
    BOOST_TEST(all.alone(start + 3 * cycle));
    all.gone(8, start + 3 * cycle);
    BOOST_TEST(!all.alone(start + 3 * cycle + longest / 2)); // one that closely followed it
    all.gone(9, start + 3 * cycle + 2 * longest);            // however late it was sent
    BOOST_TEST(!all.alone(start + 4 * cycle));
}

BOOST_AUTO_TEST_CASE(updates_wait_while_each_turn_adds_more) {
    cles::core::update_coalescer all;
    all.gone(1, start);
    BOOST_TEST(all.waits(2, start));
    BOOST_TEST(all.waits(3, start));
    BOOST_TEST(!all.waits(3, start));
}

BOOST_AUTO_TEST_CASE(they_wait_for_a_limited_time) {
    cles::core::update_coalescer all;
    all.gone(0, start);
    BOOST_TEST(all.waits(1, start));
    BOOST_TEST(all.waits(2, start + longest / 2));
    BOOST_TEST(!all.waits(3, start + longest));
    all.gone(3, start + longest);
    BOOST_TEST(all.waits(4, start + longest));
    BOOST_TEST(!all.waits(5, start + 2 * longest));
}

BOOST_AUTO_TEST_CASE(they_wait_for_a_limited_number) {
    cles::core::update_coalescer all;
    all.gone(100, start);
    BOOST_TEST(all.waits(100 + all.most - 1, start));
    BOOST_TEST(!all.waits(100 + all.most, start));
}

BOOST_AUTO_TEST_SUITE_END()
