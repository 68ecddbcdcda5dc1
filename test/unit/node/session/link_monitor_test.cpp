// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_monitor.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <vector>

namespace link_monitor {
namespace {

using namespace std::chrono_literals;
using cles::core::link_monitor;

struct fixture : link_monitor::owner {
    [[nodiscard]] bool is_idle() const override { return rests; }
    void on_silence() override { ++silences; }
    void evict() override {}
    void on_probe() override {
        probes.push_back(std::chrono::duration_cast<std::chrono::milliseconds>(clock.now() - begun));
        if (lost_at_probe) {
            monitor.stop();
        }
    }
    void pass(std::chrono::milliseconds by) {
        for (; by > 0ms; by -= 100ms) {
            clock.advance(100ms);
            deadlines.expire(clock.now());
        }
    }

    cles::limits bounds;
    cles::test::manual_clock clock;
    cles::time_point begun = clock.now();
    cles::core::deadline_queue deadlines;
    int silences = 0;
    bool rests = true;
    std::vector<std::chrono::milliseconds> probes{};
    bool lost_at_probe = false;
    link_monitor monitor{*this, deadlines, bounds, clock.now()};
};

} // namespace
} // namespace link_monitor

BOOST_FIXTURE_TEST_SUITE(link_monitor, fixture)

BOOST_AUTO_TEST_CASE(a_link_without_a_line_is_silent_after_a_minute) {
    monitor.expect_line();
    pass(59'900ms);
    BOOST_TEST(silences == 0);
    BOOST_TEST(!monitor.has_received());
    pass(100ms);
    BOOST_TEST(silences == 1);
    pass(1h);
    BOOST_TEST(silences == 1);
}

BOOST_AUTO_TEST_CASE(after_its_first_line_a_link_may_be_silent_for_ever) {
    monitor.expect_line();
    pass(50s);
    monitor.on_line(clock.now());
    BOOST_TEST(monitor.has_received());
    BOOST_TEST(deadlines.size() == 0U);
    pass(1h);
    monitor.on_line(clock.now());
    BOOST_TEST((monitor.last_line() == clock.now()));
    BOOST_TEST(silences == 0);
    BOOST_TEST(probes.empty());
}

BOOST_AUTO_TEST_CASE(the_time_for_the_first_line_can_be_set) {
    bounds.first_line = 2s;
    monitor.expect_line();
    pass(2s);
    BOOST_TEST(silences == 1);
}

BOOST_AUTO_TEST_CASE(zero_means_for_ever_and_the_longest_time_does_not_overflow) {
    bounds.first_line = 0ms;
    monitor.expect_line();
    BOOST_TEST(deadlines.size() == 0U);
    bounds.first_line = std::chrono::milliseconds::max();
    monitor.expect_line();
    pass(1h);
    BOOST_TEST(silences == 0);
    bounds.probe = std::chrono::milliseconds::max();
    monitor.on_end(clock.now());
    pass(1h);
    BOOST_TEST(probes.empty());
    bounds.probe = 0ms;
    monitor.on_end(clock.now());
    pass(100ms);
    BOOST_TEST(probes.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_peer_that_ended_its_stream_is_probed_after_5_s_and_then_every_15) {
    monitor.on_line(clock.now());
    monitor.on_end(clock.now());
    BOOST_TEST(monitor.is_half_closed());
    pass(66s);
    const std::vector<std::chrono::milliseconds> expected{5s, 20s, 35s, 50s, 65s};
    BOOST_TEST((probes == expected));
}

BOOST_AUTO_TEST_CASE(the_pauses_are_three_times_the_first_and_never_more_than_15_s) {
    bounds.probe = 1s;
    monitor.on_end(clock.now());
    pass(8s);
    const std::vector<std::chrono::milliseconds> expected{1s, 4s, 7s};
    BOOST_TEST((probes == expected));
    bounds.probe = 20s;
    probes.clear();
    begun = clock.now();
    monitor.on_end(clock.now());
    pass(36s);
    const std::vector<std::chrono::milliseconds> slow{20s, 35s};
    BOOST_TEST((probes == slow));
}

BOOST_AUTO_TEST_CASE(a_probe_that_finds_the_link_lost_is_the_last) {
    monitor.on_end(clock.now());
    lost_at_probe = true;
    pass(1min);
    BOOST_TEST(probes.size() == 1U);
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(a_link_that_ends_is_no_longer_watched) {
    monitor.expect_line();
    monitor.stop();
    pass(2min);
    BOOST_TEST(silences == 0);
    monitor.on_end(clock.now());
    monitor.stop();
    pass(2min);
    BOOST_TEST(probes.empty());
}

BOOST_AUTO_TEST_CASE(a_source_is_dropped_after_a_minute_of_silence) {
    monitor.expect_datagrams();
    pass(59s);
    BOOST_TEST(silences == 0);
    pass(1s);
    BOOST_TEST(silences == 1);
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(each_datagram_restarts_the_minute) {
    monitor.expect_datagrams();
    for (int i = 0; i < 10; ++i) {
        monitor.on_line(clock.now());
        pass(50s);
    }
    BOOST_TEST(silences == 0);
    pass(10s);
    BOOST_TEST(silences == 1);
}

BOOST_AUTO_TEST_CASE(it_stays_while_state_is_kept_for_it) {
    monitor.expect_datagrams();
    rests = false;
    pass(10min);
    BOOST_TEST(silences == 0);
    rests = true;
    pass(1min);
    BOOST_TEST(silences == 1);
}

BOOST_AUTO_TEST_CASE(after_the_end_it_does_nothing) {
    monitor.expect_datagrams();
    monitor.stop();
    pass(1h);
    BOOST_TEST(silences == 0);
}

BOOST_AUTO_TEST_SUITE_END()
