// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_watchdog.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <vector>

BOOST_AUTO_TEST_SUITE(worker_watchdog)

using namespace std::chrono_literals;
using cles::time_point;

// Two workers, one replacement, a grace period of 2 s.
struct fixture {
    using stuck_worker = cles::runtime::worker_watchdog::stuck_worker;

    std::vector<stuck_worker> check(std::chrono::nanoseconds after) {
        std::vector<stuck_worker> found;
        watch.check(start + after, [&](const stuck_worker& each) { found.push_back(each); });
        return found;
    }
    void begin(std::size_t slot, const int& job, std::chrono::nanoseconds deadline) {
        watch.begin(slot, &job, start, start + deadline);
    }

    cles::runtime::worker_watchdog watch{2, 1, 2s};
    time_point start{1h};
    int a = 0;
    int b = 0;
    int c = 0;
};

BOOST_FIXTURE_TEST_CASE(each_worker_has_its_own_slot, fixture) {
    const auto first = watch.enter();
    const auto second = watch.enter();
    BOOST_TEST(first != second);
    watch.leave(first);
    BOOST_TEST(watch.enter() == first);
    BOOST_TEST(watch.allowed() == 2U);
    BOOST_TEST(watch.usable() == 2U);
}

BOOST_FIXTURE_TEST_CASE(a_job_past_its_deadline_and_the_grace_is_found_once, fixture) {
    const auto slot = watch.enter();
    begin(slot, a, 5s);
    BOOST_TEST(check(7s).empty());
    const auto found = check(7s + 1ns);
    BOOST_TEST_REQUIRE(found.size() == 1U);
    BOOST_TEST(found[0].slot == slot);
    BOOST_TEST(found[0].job == &a);
    BOOST_TEST((found[0].busy_for == 7s + 1ns));
    BOOST_TEST(found[0].replaced);
    BOOST_TEST(check(1h).empty());
    BOOST_TEST(watch.stuck() == 1U);
    BOOST_TEST(watch.allowed() == 3U);
    BOOST_TEST(watch.usable() == 2U);
}

BOOST_FIXTURE_TEST_CASE(grace_begins_when_the_job_is_told_to_stop, fixture) {
    const auto slot = watch.enter();
    begin(slot, a, 1h);
    watch.stop(slot, &a, start + 1s);
    BOOST_TEST(check(3s).empty());
    BOOST_TEST(check(3s + 1ns).size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(a_late_stop_does_not_extend_the_grace, fixture) {
    const auto slot = watch.enter();
    begin(slot, a, 1s);
    watch.stop(slot, &a, start + 2s);
    BOOST_TEST(check(3s + 1ns).size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(stopping_an_ended_job_does_not_affect_the_next, fixture) {
    const auto slot = watch.enter();
    begin(slot, a, 1h);
    watch.end(slot);
    begin(slot, b, 1h);
    watch.stop(slot, &a, start);
    BOOST_TEST(check(10s).empty());
}

BOOST_FIXTURE_TEST_CASE(an_idle_worker_is_not_stuck, fixture) {
    const auto slot = watch.enter();
    begin(slot, a, 1s);
    BOOST_TEST(!watch.end(slot));
    BOOST_TEST(check(1h).empty());
}

BOOST_FIXTURE_TEST_CASE(replacements_are_limited, fixture) {
    begin(watch.enter(), a, 1s);
    begin(watch.enter(), b, 2s);
    BOOST_TEST(check(3500ms).at(0).replaced);
    const auto third = watch.enter();
    begin(third, c, 1s);
    const auto found = check(1min);
    BOOST_TEST_REQUIRE(found.size() == 2U);
    BOOST_TEST(!found[0].replaced);
    BOOST_TEST(!found[1].replaced);
    BOOST_TEST(watch.usable() == 0U);
    BOOST_TEST(watch.allowed() == 3U);
}

BOOST_FIXTURE_TEST_CASE(a_worker_that_returns_makes_its_replacement_surplus, fixture) {
    const auto slot = watch.enter();
    begin(slot, a, 1s);
    check(1min);
    BOOST_TEST(watch.allowed() == 3U);
    BOOST_TEST(watch.end(slot));
    BOOST_TEST(watch.allowed() == 2U);
    BOOST_TEST(watch.usable() == 2U);
    BOOST_TEST(watch.stuck() == 0U);
    begin(slot, b, 1s); // and can be found again
    BOOST_TEST(check(1min).size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
