// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_monitor.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

namespace idle_timer {
namespace {

using namespace std::chrono_literals;

struct fixture : cles::core::idle_timer::keeper {
    [[nodiscard]] bool is_idle() const override { return rests; }
    void on_quiet() override { ++ends; }
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }

    bool rests = true;
    int ends = 0;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::idle_timer life{*this, deadlines, clock.now()};
};

} // namespace
} // namespace idle_timer

BOOST_FIXTURE_TEST_SUITE(idle_timer, fixture)

BOOST_AUTO_TEST_CASE(a_source_is_dropped_after_a_minute_of_silence) {
    pass(59s);
    BOOST_TEST(ends == 0);
    pass(1s);
    BOOST_TEST(ends == 1);
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(each_datagram_restarts_the_minute) {
    for (int i = 0; i < 10; ++i) {
        life.on_datagram(clock.now());
        pass(50s);
    }
    BOOST_TEST(ends == 0);
    pass(10s);
    BOOST_TEST(ends == 1);
}

BOOST_AUTO_TEST_CASE(it_stays_while_state_is_kept_for_it) {
    rests = false;
    pass(10min);
    BOOST_TEST(ends == 0);
    rests = true;
    pass(1min);
    BOOST_TEST(ends == 1);
}

BOOST_AUTO_TEST_CASE(after_the_end_it_does_nothing) {
    life.end();
    pass(1h);
    BOOST_TEST(ends == 0);
}

BOOST_AUTO_TEST_SUITE_END()
