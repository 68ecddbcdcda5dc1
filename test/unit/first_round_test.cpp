// SPDX-License-Identifier: BSL-1.0
#include "core/first_round.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

namespace first_round {
namespace {

using namespace std::chrono_literals;

struct fixture : cles::core::first_round::listener {
    void on_round_over() override { ++told; }
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }

    int told = 0;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::first_round round{*this, deadlines};
};

} // namespace
} // namespace first_round

BOOST_FIXTURE_TEST_SUITE(first_round, fixture)

BOOST_AUTO_TEST_CASE(without_a_group_there_is_none) { BOOST_TEST(round.over()); }

BOOST_AUTO_TEST_CASE(it_lasts_300_ms_from_when_it_begins) {
    round.expect();
    pass(10s); // the executor did not run
    BOOST_TEST(!round.over());
    round.begin(clock.now());
    pass(299ms);
    BOOST_TEST(!round.over());
    BOOST_TEST(told == 0);
    pass(1ms);
    BOOST_TEST(round.over());
    BOOST_TEST(told == 1);
}

BOOST_AUTO_TEST_CASE(once_stopped_it_is_over_without_a_word) {
    round.expect();
    round.begin(clock.now());
    round.stop();
    BOOST_TEST(round.over());
    pass(1s);
    BOOST_TEST(told == 0);
}

BOOST_AUTO_TEST_SUITE_END()
