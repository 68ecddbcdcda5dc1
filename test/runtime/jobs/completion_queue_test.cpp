// SPDX-License-Identifier: BSL-1.0
#include "jobs/completion_queue.hpp"

#include <boost/test/unit_test.hpp>

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

BOOST_AUTO_TEST_SUITE(completion_queue)

using cles::runtime::job_record;
using queue = cles::runtime::completion_queue;

// The queue does not use it.
job_record* some_record(std::uintptr_t number) { return reinterpret_cast<job_record*>(number); }

struct fixture {
    std::vector<queue::entry> take() {
        entries.clear();
        functions.clear();
        results.take(entries, functions);
        return entries;
    }

    std::atomic<int> woken{0};
    queue results{[this] { ++woken; }};
    std::vector<queue::entry> entries;
    std::vector<queue::function> functions;
};

BOOST_FIXTURE_TEST_CASE(the_first_entry_wakes_the_executor, fixture) {
    BOOST_TEST(results.push({some_record(8), queue::event::answered}));
    BOOST_TEST(results.push({some_record(16), queue::event::progress}));
    BOOST_TEST(results.post([] {}));
    BOOST_TEST(woken == 1);
    const auto got = take();
    BOOST_TEST_REQUIRE(got.size() == 2U);
    BOOST_TEST(got[0].record == some_record(8));
    BOOST_TEST(got[1].record == some_record(16));
    BOOST_TEST(functions.size() == 1U);
    BOOST_TEST(take().empty());
}

BOOST_FIXTURE_TEST_CASE(an_entry_after_take_wakes_again, fixture) {
    BOOST_TEST(results.push({some_record(8), queue::event::answered}));
    take();
    BOOST_TEST(results.push({some_record(8), queue::event::answered}));
    BOOST_TEST(woken == 2);
}

BOOST_FIXTURE_TEST_CASE(a_deferred_entry_does_not_wake, fixture) {
    BOOST_TEST(results.push({some_record(8), queue::event::released}, true));
    BOOST_TEST(woken == 0);
    BOOST_TEST(results.push({some_record(16), queue::event::answered}));
    BOOST_TEST(woken == 1);
    BOOST_TEST(take().size() == 2U);
}

BOOST_FIXTURE_TEST_CASE(flush_wakes_for_deferred_entries, fixture) {
    results.flush(); // without entries
    BOOST_TEST(woken == 0);
    BOOST_TEST(results.push({some_record(8), queue::event::answered}, true));
    results.flush();
    results.flush();
    BOOST_TEST(woken == 1);
    BOOST_TEST(take().size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(posted_functions_are_bounded, fixture) {
    int taken = 0;
    while (results.post([] {})) {
        BOOST_TEST_REQUIRE(++taken < 100'000);
    }
    BOOST_TEST(taken >= 1000);
    BOOST_TEST(results.push({some_record(8), queue::event::answered})); // entries are not refused
    take();
    BOOST_TEST(results.post([] {}));
}

BOOST_FIXTURE_TEST_CASE(a_closed_queue_accepts_nothing, fixture) {
    BOOST_TEST(results.push({some_record(8), queue::event::answered}));
    results.close(entries, functions);
    BOOST_TEST(entries.size() == 1U);
    BOOST_TEST(!results.push({some_record(8), queue::event::answered}));
    BOOST_TEST(!results.post([] {}));
    BOOST_TEST(woken == 1);
}

BOOST_AUTO_TEST_CASE(no_wake_after_close_has_returned) {
    for (int round = 0; round < 200; ++round) {
        std::atomic<bool> closed{false};
        std::atomic<bool> too_late{false};
        queue results{[&] { too_late = too_late || closed; }};
        std::atomic<bool> begun{false};
        std::thread other{[&] {
            begun = true;
            while (results.push({some_record(8), queue::event::answered})) {
                std::vector<queue::entry> entries;
                std::vector<queue::function> functions;
                results.take(entries, functions);
            }
        }};
        while (!begun) {
            std::this_thread::yield();
        }
        std::vector<queue::entry> entries;
        std::vector<queue::function> functions;
        results.close(entries, functions);
        closed = true;
        other.join();
        BOOST_TEST_REQUIRE(!too_late);
    }
}

BOOST_AUTO_TEST_SUITE_END()
