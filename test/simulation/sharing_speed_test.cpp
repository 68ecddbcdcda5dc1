// SPDX-License-Identifier: BSL-1.0
// Two nodes that share their jobs use the time of all their workers, however many each has, and however long jobs take.
#include "simulation/seeds.hpp"
#include "simulation/sharing_speed.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(sharing_speed)

using namespace cles::simulation;
using namespace std::chrono_literals;

namespace {

constexpr double longest = 1.2;    // of the ideal time
constexpr double most_idle = 0.03; // of the work

constexpr unsigned jobs_of_a_burst = amount(1'800, 600);
constexpr std::size_t worker_counts[] = {1, 2, 4, 8};

void hold(shared_burst setup) {
    setup.jobs = jobs_of_a_burst;
    const auto r = simulate_burst(1, setup);
    const auto run = std::to_string(setup.workers) + " beside " + std::to_string(setup.other_workers) + " workers: ";
    expect_none(r.violations, run);
    BOOST_TEST_MESSAGE(run << to_text(r));
    BOOST_TEST(r.seconds <= longest * r.ideal, run << to_text(r));
    BOOST_TEST(r.idle_seconds <= most_idle * r.work, run << to_text(r));
}

void hold_for_all_workers(const std::vector<shared_burst::kind>& kinds) {
    for (const auto workers : worker_counts) {
        for (const auto others : worker_counts) {
            hold({.workers = workers, .other_workers = others, .kinds = kinds});
        }
    }
}

} // namespace

BOOST_AUTO_TEST_CASE(jobs_of_one_length) { hold_for_all_workers({{"work", 10ms}}); }

BOOST_AUTO_TEST_CASE(tasks_of_several_lengths) {
    hold_for_all_workers({{"short", 2ms}, {"work", 10ms}, {"long", 100ms}});
}

BOOST_AUTO_TEST_CASE(one_task_whose_jobs_have_several_lengths) {
    hold_for_all_workers({{"work", 2ms}, {"work", 10ms}, {"work", 100ms}});
}

BOOST_AUTO_TEST_CASE(an_idle_node_that_had_a_long_job) {
    hold({.workers = 1, .other_workers = 8, .before = 10s});
    hold({.workers = 4, .other_workers = 4, .before = 60s});
    hold({.workers = 1, .other_workers = 8, .kinds = {{"long", 10ms}, {"work", 10ms}}, .before = 60s});
}

BOOST_AUTO_TEST_SUITE_END()
