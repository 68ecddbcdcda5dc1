// SPDX-License-Identifier: BSL-1.0
#include "node/membership/discovery.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

namespace discovery_grace {
namespace {

using namespace std::chrono_literals;

struct fixture {
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }

    int changes = 0;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::discovery_grace grace{deadlines, [this] { ++changes; }};
};

} // namespace
} // namespace discovery_grace

BOOST_FIXTURE_TEST_SUITE(discovery_grace, fixture)

BOOST_AUTO_TEST_CASE(is_over_without_a_group) { BOOST_TEST(grace.over()); }

BOOST_AUTO_TEST_CASE(lasts_300_ms_from_its_begin) {
    grace.expect();
    pass(10s); // the executor did not run
    BOOST_TEST(!grace.over());
    grace.begin(clock.now());
    pass(299ms);
    BOOST_TEST(!grace.over());
    BOOST_TEST(changes == 0);
    pass(1ms);
    BOOST_TEST(grace.over());
    BOOST_TEST(changes == 1);
}

BOOST_AUTO_TEST_CASE(then_it_waits_for_the_seeds) {
    grace.begin(clock.now(), true);
    pass(300ms);
    BOOST_TEST(!grace.over());
    BOOST_TEST(changes == 1);
    pass(2s);
    grace.on_seeds_heard();
    BOOST_TEST(grace.over());
    BOOST_TEST(changes == 2);
    pass(10s);
    BOOST_TEST(changes == 2);
}

BOOST_AUTO_TEST_CASE(seeds_that_are_heard_early_do_not_shorten_it) {
    grace.begin(clock.now(), true);
    pass(100ms);
    grace.on_seeds_heard();
    pass(199ms);
    BOOST_TEST(!grace.over());
    pass(1ms);
    BOOST_TEST(grace.over());
    BOOST_TEST(changes == 1);
}

BOOST_AUTO_TEST_CASE(a_silent_seed_is_waited_for_four_seconds_in_all) {
    grace.begin(clock.now(), true);
    pass(300ms);
    pass(3699ms);
    BOOST_TEST(!grace.over());
    pass(1ms);
    BOOST_TEST(grace.over());
    BOOST_TEST(changes == 2);
}

BOOST_AUTO_TEST_CASE(stop_ends_it_without_notification) {
    grace.expect();
    grace.begin(clock.now());
    grace.stop();
    BOOST_TEST(grace.over());
    pass(1s);
    BOOST_TEST(changes == 0);
}

BOOST_AUTO_TEST_SUITE_END()
