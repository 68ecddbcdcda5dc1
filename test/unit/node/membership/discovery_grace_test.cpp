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

    int times_over = 0;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::discovery_grace grace{deadlines, [this] { ++times_over; }};
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
    BOOST_TEST(times_over == 0);
    pass(1ms);
    BOOST_TEST(grace.over());
    BOOST_TEST(times_over == 1);
}

BOOST_AUTO_TEST_CASE(stop_ends_it_without_notification) {
    grace.expect();
    grace.begin(clock.now());
    grace.stop();
    BOOST_TEST(grace.over());
    pass(1s);
    BOOST_TEST(times_over == 0);
}

BOOST_AUTO_TEST_SUITE_END()
