// SPDX-License-Identifier: BSL-1.0
#include "jobs/begin_gate.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

namespace begin_gate_cases {
namespace {

using namespace std::chrono_literals;
using cles::runtime::begin_gate;

struct fixture {
    /// How many rounds it takes until jobs may begin, at most so many. \param input brings something in each round
    unsigned rounds(unsigned most = 1000, bool input = false) {
        unsigned count = 0;
        while (gate.is_closed() && count < most) {
            now += 1ms;
            if (input) {
                gate.count_input();
            }
            ++count;
            const bool opened = gate.end_round(now);
            BOOST_TEST(opened != gate.is_closed());
        }
        return count;
    }

    cles::time_point now{1h};
    begin_gate gate{100ms};
};

} // namespace
} // namespace begin_gate_cases

BOOST_FIXTURE_TEST_SUITE(begin_gate, begin_gate_cases::fixture)

using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(the_first_job_waits_until_input_has_been_read) {
    BOOST_TEST((gate.open_until() < now));
    BOOST_TEST(!gate.is_open(now));
    BOOST_TEST(gate.begin_round(now));
    BOOST_TEST(gate.is_closed());
    BOOST_TEST(!gate.is_open(now));
    BOOST_TEST((gate.open_until() < now));
    BOOST_TEST(rounds() == gate.quiet_rounds);
    BOOST_TEST((gate.open_until() == now + 100ms));
    BOOST_TEST(gate.is_open(now + 100ms));
    BOOST_TEST(!gate.is_open(now + 100ms + 1ns));
}

BOOST_AUTO_TEST_CASE(jobs_begin_while_the_loop_runs_often_enough) {
    BOOST_TEST(gate.begin_round(now));
    rounds();
    for (int i = 0; i < 100; ++i) {
        now += 100ms;
        BOOST_TEST(!gate.begin_round(now));
        BOOST_TEST((gate.open_until() == now + 100ms));
    }
}

BOOST_AUTO_TEST_CASE(after_a_longer_wait_they_wait_for_input) {
    BOOST_TEST(gate.begin_round(now));
    rounds();
    const auto until = gate.open_until();
    now += 100ms + 1ns;
    BOOST_TEST(gate.begin_round(now));
    BOOST_TEST((gate.open_until() == until)); // which has passed: workers begin none
    BOOST_TEST(!gate.begin_round(now));       // it is being read already
    BOOST_TEST(gate.is_closed());
    BOOST_TEST(rounds() == gate.quiet_rounds);
    BOOST_TEST(!gate.begin_round(now + 100ms));
}

BOOST_AUTO_TEST_CASE(input_prolongs_the_reading_for_a_limited_time) {
    BOOST_TEST(gate.begin_round(now));
    rounds(gate.quiet_rounds - 1);
    BOOST_TEST(gate.is_closed());
    gate.count_input();
    BOOST_TEST(rounds() == gate.quiet_rounds + 1);
    now += 1s;
    const auto begun = now;
    BOOST_TEST(gate.begin_round(now));
    rounds(1000, true);
    BOOST_TEST(!gate.is_closed());
    BOOST_TEST((now == begun + gate.max_reading));
}

BOOST_AUTO_TEST_CASE(a_wait_during_the_reading_begins_it_anew) {
    BOOST_TEST(gate.begin_round(now));
    rounds(gate.quiet_rounds - 1);
    now += 1s;
    BOOST_TEST(rounds() == gate.quiet_rounds + 1);
}

BOOST_AUTO_TEST_CASE(without_a_limit_jobs_may_always_begin) {
    cles::runtime::begin_gate open{0ms};
    BOOST_TEST((open.open_until() == cles::time_point::max()));
    BOOST_TEST(!open.begin_round(now + 1h));
    BOOST_TEST((open.open_until() == cles::time_point::max()));
}

BOOST_AUTO_TEST_SUITE_END()
