// SPDX-License-Identifier: BSL-1.0
// Jobs that do not stop: they are reported, their workers are replaced, and they do not prevent shutdown.

#include "jobs/job_pool.hpp"
#include "pooled_node.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

BOOST_AUTO_TEST_SUITE(stuck_workers)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::runtime::drain_report;
using cles::runtime::pool_options;

struct fixture : pooled_node {
    explicit fixture(pool_options options = {.workers = 1, .replacements = 1, .grace = 20ms, .close_timeout = 20ms})
        : pooled_node(std::move(options)), client(peer()) {
        add_held();
        tasks->on_delegate("quick", [] { return 1; });
    }
    void get_stuck(int id) {
        const auto before = hold.arrived();
        client.send("DELEGATE self:held id=" + std::to_string(id) + "\n");
        wait_for([&] { return hold.arrived() == before + 1; });
        // Only now, because a job whose deadline passes before it starts does not get stuck.
        client.send("PUSH self:cles/cancel/" + std::to_string(id) + " id=99\n");
        BOOST_TEST(client.line().find(R"({"error":"cancelled")") != std::string::npos);
        BOOST_TEST(client.line() == "id=99 {}");
        const auto stuck = static_cast<std::uint64_t>(before) + 1;
        wait_for([&] { return pool->figures().stuck == stuck; });
    }
    drain_report drain(std::chrono::milliseconds limit) {
        std::optional<drain_report> report;
        pool->drain(limit, [&](const drain_report& result) { report = result; });
        wait_for([&] { return report.has_value(); });
        return *report;
    }

    scripted_peer client;
};

BOOST_FIXTURE_TEST_CASE(a_stuck_worker_is_reported_and_replaced, fixture) {
    get_stuck(1);
    BOOST_TEST(client.ask("DELEGATE self:quick id=2") == R"(id=2 {"value":1})");
    BOOST_TEST(log.has("worker 1 is stuck in DELEGATE 'held'"));
    BOOST_TEST(log.has("replaced by another"));
    const auto figures = pool->figures();
    BOOST_TEST(figures.stuck == 1U);
    BOOST_TEST(figures.replaced == 1U);
    BOOST_TEST(figures.stuck_now == 1U);
    BOOST_TEST(pool->load().workers == 1U);
    hold.open();
    wait_for([&] { return pool->figures().revived == 1; });
    BOOST_TEST(pool->figures().stuck_now == 0U);
    BOOST_TEST(pool->load().workers == 1U);
    BOOST_TEST(client.ask("DELEGATE self:quick id=3") == R"(id=3 {"value":1})");
}

BOOST_FIXTURE_TEST_CASE(without_replacements_new_jobs_are_refused, fixture) {
    get_stuck(1);
    get_stuck(2);
    wait_for([&] { return pool->load().workers == 0; });
    BOOST_TEST(log.has("no replacement is left"));
    const auto reply = client.ask("DELEGATE self:quick id=3");
    BOOST_TEST(reply.starts_with(R"(id=3 {"error":"busy","message":"car1: all its workers are stuck")"), reply);
    hold.open();
    wait_for([&] { return pool->figures().revived == 2; });
    BOOST_TEST(client.ask("DELEGATE self:quick id=4") == R"(id=4 {"value":1})");
}

BOOST_FIXTURE_TEST_CASE(a_stuck_job_does_not_delay_shutdown, fixture) {
    get_stuck(1);
    const auto report = drain(30ms);
    BOOST_TEST(report.refused == 0U);
    BOOST_TEST(report.stuck == 1U);
    const auto before = std::chrono::steady_clock::now();
    tasks.reset();
    pool.reset();
    BOOST_TEST((std::chrono::steady_clock::now() - before < patience));
    BOOST_TEST(log.has("workers abandoned in jobs that do not end: 1"));
    BOOST_TEST(hold.passed() == 0);
    hold.open();
    while (hold.passed() == 0) { // its state still exists
        std::this_thread::yield();
    }
}

BOOST_AUTO_TEST_CASE(a_drain_waits_for_running_and_queued_jobs) {
    fixture node{{.workers = 1}};
    node.client.send("DELEGATE self:held id=1\nDELEGATE self:quick id=2\n");
    node.wait_for([&] { return node.hold.arrived() == 1 && node.pool->load().queued == 1; });
    std::optional<drain_report> report;
    node.pool->drain(patience, [&](const drain_report& result) { report = result; });
    BOOST_TEST(node.client.ask("DELEGATE self:quick id=3") ==
               R"(id=3 {"error":"busy","message":"car1: it is shutting down","retry_ms":1000})");
    BOOST_TEST(!report.has_value());
    node.hold.open();
    BOOST_TEST(node.client.line() == R"(id=1 {"value":1})");
    BOOST_TEST(node.client.line() == R"(id=2 {"value":1})");
    node.wait_for([&] { return report.has_value(); });
    BOOST_TEST(report->refused + report->abandoned + report->stuck == 0U);
}

BOOST_AUTO_TEST_CASE(a_drain_of_nothing_ends_at_once) {
    fixture node{{.workers = 1}};
    const auto report = node.drain(patience);
    BOOST_TEST(report.refused + report.abandoned + report.stuck == 0U);
}

BOOST_AUTO_TEST_CASE(at_the_limit_of_a_drain_open_jobs_are_answered) {
    fixture node{{.workers = 1, .close_timeout = 20ms}};
    node.client.send("DELEGATE self:held id=1\nDELEGATE self:quick id=2\n");
    node.wait_for([&] { return node.hold.arrived() == 1 && node.pool->load().queued == 1; });
    const auto report = node.drain(10ms);
    BOOST_TEST(report.refused == 1U);
    BOOST_TEST(report.abandoned == 1U);
    BOOST_TEST(report.stuck == 1U);
    const auto first = node.client.line();
    const auto second = node.client.line();
    BOOST_TEST((first + second).find(R"(id=1 {"error":"unavailable")") != std::string::npos);
    BOOST_TEST((first + second).find(R"(id=2 {"error":"busy")") != std::string::npos);
}

// The run ends although the pool exists, because the timer has been cancelled.
BOOST_AUTO_TEST_CASE(a_drain_that_ends_cancels_its_timer) {
    pooled_node node{{.workers = 1}};
    int ends = 0;
    node.pool->drain(1h, [&](const drain_report&) {
        ++ends;
        node.car.stop();
    });
    node.io.run();
    BOOST_TEST(ends == 1);
}

BOOST_AUTO_TEST_CASE(a_drain_ends_once_if_its_limit_has_passed_already) {
    fixture node{{.workers = 1, .close_timeout = 20ms}};
    node.client.send("DELEGATE self:held id=1\n");
    node.wait_for([&] { return node.hold.arrived() == 1; });
    int ends = 0;
    std::size_t stuck = 0;
    node.pool->drain(0ms, [&](const drain_report& result) {
        ++ends;
        stuck = result.stuck;
    });
    node.wait_for([&] { return ends == 1; });
    BOOST_TEST(stuck == 1U);
    node.hold.open();
    node.wait_for([&] { return node.pool->figures().running == 0; });
    BOOST_TEST(ends == 1);
}

BOOST_AUTO_TEST_CASE(a_drain_of_a_closed_pool_calls_nothing) {
    pooled_node node{{.workers = 1}};
    int ends = 0;
    node.pool->drain(1h, [&](const drain_report&) { ++ends; });
    node.tasks.reset();
    node.pool.reset();
    node.car.stop();
    node.io.run();
    BOOST_TEST(ends == 0);
}

BOOST_AUTO_TEST_CASE(a_job_that_stops_when_told_ends_with_the_pool) {
    notes events;
    {
        fixture node{{.workers = 1, .close_timeout = patience}};
        node.add("polite", [&](const cles::responder& job) {
            events.add("begun");
            while (!job.stopped()) {
                std::this_thread::sleep_for(1ms);
            }
            events.add("ended");
        });
        node.client.send("DELEGATE self:polite id=1\n");
        node.wait_for([&] { return events.size() == 1; });
    }
    BOOST_TEST(events.joined() == "begun ended");
}

BOOST_AUTO_TEST_SUITE_END()
