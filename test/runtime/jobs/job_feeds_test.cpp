// SPDX-License-Identifier: BSL-1.0
// Jobs that bind nouns of other nodes, and hold no worker while they wait for updates.

#include "jobs/job_feeds.hpp"
#include "jobs/job_pool.hpp"
#include "pooled_node.hpp"
#include "support/metric.hpp"

#include <boost/test/unit_test.hpp>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

BOOST_AUTO_TEST_SUITE(job_feeds)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;
using cles::feed_event;

std::string text_of(boost::system::error_code code, const cles::job_event& event) {
    return code                             ? "ended:" + std::string{cles::wire_name(static_cast<errc>(code.value()))}
           : event.kind == feed_event::gap  ? "gap:" + std::to_string(event.missed)
           : event.kind == feed_event::lost ? "lost"
           : event.has_value()              ? std::to_string(event.as<int>())
                                            : "rebound";
}

// A node with one worker, whose jobs follow what another one publishes.
struct fixture {
    fixture() {
        left.car.set_peer("right", right.endpoints().front());
        right.update("wind", 0);
    }
    /// Adds a job that notes each event, in order, until its feed ends.
    void add_following(const cles::bind_options& options = {}) {
        left.add("following",
                 [this, options](const cles::responder& job) { follow(job, job.bind("right:wind", options)); });
    }
    void follow(const cles::responder& job, const cles::job_feed& from) {
        from.next([this, job, from](boost::system::error_code code, const cles::job_event& event) {
            elsewhere = elsewhere && std::this_thread::get_id() != io_thread;
            alone = alone && ++inside == 1;
            events.add(text_of(code, event));
            if (held) {
                left.hold.pass();
            }
            --inside;
            if (code) {
                job.done();
            } else {
                follow(job, from);
            }
        });
    }
    void until_noted(std::size_t count) {
        left.wait_for([&] { return events.size() == count; });
    }
    void end_pool() {
        left.tasks.reset();
        left.pool.reset();
    }

    std::thread::id io_thread = std::this_thread::get_id();
    std::atomic<bool> held{false}; // callbacks wait at the gate
    std::atomic<bool> elsewhere{true};
    std::atomic<bool> alone{true};
    std::atomic<int> inside{0};
    notes events; // before the nodes, whose jobs use them
    pooled_node left{{.workers = 1, .queue = 64}};
    cles::service right{left.io, listening("right")};
};

BOOST_FIXTURE_TEST_CASE(a_job_that_waits_for_updates_leaves_the_only_worker_to_others, fixture) {
    add_following();
    left.add("quick", [](const cles::responder& job) { job.done(1); });
    auto client = left.peer();
    auto other = left.peer();
    client.send("DELEGATE self:following id=1\n");
    until_noted(1);
    left.wait_for([&] { return left.pool->figures().running == 0; });
    BOOST_TEST(left.pool->figures().waiting == 1U);
    BOOST_TEST(other.ask("DELEGATE self:quick") == R"({"value":1})");
    for (int i = 1; i <= 20; ++i) {
        right.update("wind", i);
        until_noted(1 + static_cast<std::size_t>(i));
        BOOST_TEST(other.ask("DELEGATE self:quick") == R"({"value":1})");
    }
    BOOST_TEST(events.joined() == "0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20");
    BOOST_TEST(elsewhere);
    BOOST_TEST(alone);
}

BOOST_FIXTURE_TEST_CASE(a_job_that_is_slow_misses_updates_and_is_told_how_many, fixture) {
    held = true;
    add_following(cles::bind_options{}.keep(2));
    auto client = left.peer();
    client.send("DELEGATE self:following id=1\n");
    until_noted(1); // its callback holds the worker
    for (int i = 1; i <= 10; ++i) {
        right.update("wind", i);
        run_ready(left.io);
    }
    BOOST_TEST(events.size() == 1U);
    held = false;
    left.hold.open();
    until_noted(4);
    BOOST_TEST(events.joined() == "0 gap:8 9 10");
    BOOST_TEST(alone);
}

BOOST_FIXTURE_TEST_CASE(an_event_tells_how_long_it_has_waited_for_a_worker, fixture) {
    std::atomic<std::int64_t> waited{-1};
    left.add("following", [&](const cles::responder& job) {
        const auto from = job.bind("right:wind");
        from.next([&, job, from](boost::system::error_code, const cles::job_event& event) {
            waited = event.waited.count();
            job.done();
        });
        std::this_thread::sleep_for(50ms); // in the only worker, while the value arrives
    });
    BOOST_TEST(left.peer().ask("DELEGATE self:following") == "{}");
    BOOST_TEST(waited >= 0);
    BOOST_TEST(waited < std::chrono::nanoseconds{patience}.count());
}

BOOST_FIXTURE_TEST_CASE(the_feed_of_a_withdrawn_job_ends, fixture) {
    add_following();
    auto client = left.peer();
    client.send("DELEGATE self:following id=1\n");
    until_noted(1);
    client.send("PUSH self:cles/cancel/1 id=2\n");
    BOOST_TEST(client.line().starts_with(R"(id=1 {"error":"cancelled")"));
    until_noted(2);
    BOOST_TEST(events.joined() == "0 ended:cancelled");
    left.wait_for([&] { return left.pool->load().running == 0; });
    const auto before = metric(right, "updates_delivered");
    right.update("wind", 1);
    run_ready(left.io);
    BOOST_TEST(metric(right, "updates_delivered") == before);
}

BOOST_FIXTURE_TEST_CASE(a_feed_that_nobody_holds_any_more_is_unbound, fixture) {
    std::unique_ptr<cles::responder> kept;
    left.add("binding", [&](const cles::responder& job) {
        kept = std::make_unique<cles::responder>(job);
        const auto from = job.bind("right:wind");
        from.next(
            [&](boost::system::error_code code, const cles::job_event& event) { events.add(text_of(code, event)); });
    });
    auto client = left.peer();
    client.send("DELEGATE self:binding id=1\n");
    until_noted(1); // the value, or that it was closed before
    run_ready(left.io);
    const auto before = metric(right, "updates_delivered");
    right.update("wind", 1);
    run_ready(left.io);
    BOOST_TEST(metric(right, "updates_delivered") == before);
    kept->done(1);
    BOOST_TEST(client.line() == R"(id=1 {"value":1})");
    kept.reset();
}

BOOST_FIXTURE_TEST_CASE(what_a_callback_throws_is_the_answer, fixture) {
    left.add("following", [](const cles::responder& job) {
        const auto from = job.bind("right:wind");
        from.next([job, from](boost::system::error_code, const cles::job_event&) {
            throw cles::error(errc::denied, "not that one");
        });
    });
    BOOST_TEST(left.peer().ask("DELEGATE self:following") == R"({"error":"denied","message":"car1: not that one"})");
}

BOOST_FIXTURE_TEST_CASE(closing_the_pool_ends_the_feeds, fixture) {
    add_following();
    auto client = left.peer();
    client.send("DELEGATE self:following id=1\n");
    until_noted(1);
    end_pool();
    BOOST_TEST(events.joined() == "0 ended:unavailable");
    BOOST_TEST(client.line().starts_with(R"(id=1 {"error":"unavailable")"));
    run_ready(left.io);
    BOOST_TEST(events.size() == 2U); // once
}

BOOST_FIXTURE_TEST_CASE(closing_the_pool_ends_feeds_that_have_not_been_bound, fixture) {
    notes begun;
    left.add("following", [&](const cles::responder& job) {
        follow(job, job.bind("right:wind"));
        begun.add("once");
    });
    auto client = left.peer();
    client.send("DELEGATE self:following id=1\n");
    left.wait_for([&] { return left.pool->figures().admitted == 1; });
    while (begun.size() == 0) { // the executor does not run
        std::this_thread::yield();
    }
    end_pool();
    BOOST_TEST((events.joined() == "ended:cancelled" || events.joined() == "ended:unavailable"), events.joined());
    run_ready(left.io);
    BOOST_TEST(events.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
