// SPDX-License-Identifier: BSL-1.0
#include "jobs/current_trace.hpp"
#include "jobs/job_times.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string_view>
#include <thread>

BOOST_AUTO_TEST_SUITE(job_times)

using namespace std::chrono_literals;
using cles::runtime::current_trace;
using phase = cles::runtime::job_times::phase;

namespace {

constexpr cles::time_point start{1h};
constexpr std::string_view trace = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";

} // namespace

BOOST_AUTO_TEST_CASE(what_a_job_does_is_added_up) {
    cles::runtime::job_times times;
    times.begin(phase::queued, start);
    times.begin(phase::running, start + 5ms);
    times.begin(phase::elsewhere, start + 7ms);
    times.begin(phase::queued, start + 100ms); // its request has been answered
    times.begin(phase::running, start + 103ms);
    const auto found = times.take(start + 107ms); // it still runs
    BOOST_TEST((found.queued == 8ms));
    BOOST_TEST((found.ran == 6ms));
}

BOOST_AUTO_TEST_CASE(each_time_is_taken_once) {
    cles::runtime::job_times times;
    times.begin(phase::queued, start);
    BOOST_TEST((times.take(start + 5ms).queued == 5ms));
    BOOST_TEST((times.take(start + 6ms).queued == 1ms));
    times.begin(phase::elsewhere, start + 6ms);
    BOOST_TEST((times.take(start + 9ms).queued == 0ms));
}

BOOST_AUTO_TEST_CASE(nothing_counts_after_the_answer) {
    cles::runtime::job_times times;
    times.begin(phase::running, start);
    times.freeze(start + 2ms);
    times.begin(phase::queued, start + 50ms);
    const auto found = times.take(start + 90ms);
    BOOST_TEST((found.ran == 2ms));
    BOOST_TEST((found.queued == 0ms));
    times.reset(); // for another job
    times.begin(phase::running, start + 100ms);
    BOOST_TEST((times.take(start + 101ms).ran == 1ms));
}

BOOST_AUTO_TEST_CASE(the_trace_of_a_thread) {
    BOOST_TEST(current_trace::id().empty());
    {
        const current_trace outer{trace};
        BOOST_TEST(current_trace::id() == "4bf92f3577b34da6a3ce929d0e0e4736");
        std::string_view elsewhere = "?";
        std::thread{[&] { elsewhere = current_trace::id(); }}.join();
        BOOST_TEST(elsewhere.empty());
        {
            const current_trace inner{""};
            BOOST_TEST(current_trace::id().empty());
        }
        BOOST_TEST(!current_trace::id().empty());
    }
    BOOST_TEST(current_trace::id().empty());
}

BOOST_AUTO_TEST_SUITE_END()
