// SPDX-License-Identifier: BSL-1.0
// Workers that find the executor late start no job until it has caught up.

#include "jobs/completion_queue.hpp"
#include "jobs/job_pool.hpp"
#include "jobs/job_record.hpp"
#include "jobs/worker_pool.hpp"
#include "pooled_node.hpp"

#include <boost/test/unit_test.hpp>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

BOOST_AUTO_TEST_SUITE(late_executor)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::runtime::worker_pool;

namespace {

bool happens(const std::atomic<int>& counter, int at_least) {
    const auto end = std::chrono::steady_clock::now() + patience;
    while (counter < at_least && std::chrono::steady_clock::now() < end) {
        std::this_thread::yield();
    }
    return counter >= at_least;
}

} // namespace

// The executor may have handled the pause before the worker puts its job back: then only a `wake` follows.
BOOST_AUTO_TEST_CASE(a_worker_that_requeues_its_job_continues_when_woken) {
    cles::runtime::job_record_pool records;
    auto& job = records.acquire({});
    cles::runtime::completion_queue completions{[] {}};
    const auto workers = std::make_shared<worker_pool>(cles::runtime::pool_options{.workers = 1}, completions);
    std::atomic<int> missed{0};
    workers->start(workers, [&] { ++missed; });
    workers->set_executor_due(cles::time_point::clock::now() - 1s);
    BOOST_TEST((workers->push(job) == worker_pool::admission::needs_wake));
    for (int i = 1; i <= 3; ++i) {
        workers->wake();
        BOOST_REQUIRE(happens(missed, i));
        while (workers->read_figures().queued == 0) {
            std::this_thread::yield();
        }
    }
    BOOST_TEST(workers->withdraw(job));
    workers->close();
    BOOST_TEST(workers->join(patience) == 0U);
    records.recycle(job);
}

// An executor whose timer is always late.
BOOST_AUTO_TEST_CASE(all_jobs_complete_although_the_executor_is_often_late) {
    pooled_node node{{.workers = 16, .grace = 4ms, .max_wait = 2ms, .check_interval = 1ms, .executor_lateness = 0ms}};
    node.tasks->on_delegate("quick", [] { return 1; });
    auto client = node.peer();
    constexpr int burst = 64;
    const auto end = std::chrono::steady_clock::now() + 1s;
    int bursts = 0;
    while (std::chrono::steady_clock::now() < end) {
        std::string asked;
        for (int i = 1; i <= burst; ++i) {
            asked += "DELEGATE self:quick id=" + std::to_string(i) + " deadline=60000\n";
        }
        client.send(asked);
        for (int i = 0; i < burst; ++i) {
            const auto answer = client.line();
            BOOST_REQUIRE_MESSAGE(answer.ends_with(R"( {"value":1})"), answer);
        }
        ++bursts;
    }
    BOOST_TEST(bursts > 0);
}

BOOST_AUTO_TEST_SUITE_END()
