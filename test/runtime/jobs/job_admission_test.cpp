// SPDX-License-Identifier: BSL-1.0
// Which jobs are admitted, in which order they run, and which are removed.

#include "jobs/job_pool.hpp"
#include "pooled_node.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

BOOST_AUTO_TEST_SUITE(job_admission)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::runtime::pool_options;

// One worker, which is blocked at a gate, and capacity for four jobs.
struct fixture : pooled_node {
    explicit fixture(pool_options options = {.workers = 1, .queue = 4})
        : pooled_node(std::move(options)), client(peer()) {
        add_held();
        tasks->on_delegate("note", [this](const cles::request& r) { ran.add(std::string{r.parameter(0)}); });
    }
    void occupy() {
        client.send("DELEGATE self:held id=1\n");
        wait_for([&] { return hold.arrived() == 1; });
    }
    void queue(scripted_peer& from, const std::string& name, int id) {
        const auto before = pool->figures().admitted;
        from.send("DELEGATE self:note/" + name + " id=" + std::to_string(id) + "\n");
        wait_for([&] { return pool->figures().admitted == before + 1; });
    }

    notes ran;
    scripted_peer client;
};

BOOST_FIXTURE_TEST_CASE(a_full_queue_is_busy_with_a_retry_delay, fixture) {
    occupy();
    for (int i = 2; i < 6; ++i) {
        queue(client, "x", i);
    }
    BOOST_TEST(pool->load().queued == 4U);
    BOOST_TEST(pool->load().running == 1U);
    BOOST_TEST(client.ask("DELEGATE self:note/late id=9") ==
               R"(id=9 {"error":"busy","message":"car1: its queue is full","retry_ms":10})");
    BOOST_TEST(pool->figures().refused == 1U);
    hold.open();
    for (int i = 0; i < 5; ++i) {
        BOOST_TEST(client.line().find("error") == std::string::npos);
    }
    BOOST_TEST(client.ask("DELEGATE self:note/again id=9") == "id=9 {}");
}

BOOST_FIXTURE_TEST_CASE(links_take_turns, fixture) {
    occupy();
    auto other = peer();
    queue(client, "a1", 2);
    queue(client, "a2", 3);
    queue(client, "a3", 4);
    queue(other, "b1", 2);
    hold.open();
    BOOST_TEST(other.line() == "id=2 {}");
    wait_for([&] { return ran.size() == 4; });
    BOOST_TEST(ran.joined() == "a1 b1 a2 a3");
}

BOOST_FIXTURE_TEST_CASE(a_withdrawn_job_leaves_the_queue, fixture) {
    occupy();
    queue(client, "a", 2);
    queue(client, "b", 3);
    client.send("PUSH self:cles/cancel/2 id=10\n");
    BOOST_TEST(client.line().starts_with(R"(id=2 {"error":"cancelled")"));
    BOOST_TEST(client.line() == "id=10 {}");
    wait_for([&] { return pool->load().queued == 1; });
    BOOST_TEST(pool->figures().withdrawn == 1U);
    hold.open();
    client.line();
    client.line();
    BOOST_TEST(ran.joined() == "b");
}

BOOST_FIXTURE_TEST_CASE(the_jobs_of_a_lost_link_leave_the_queue, fixture) {
    occupy();
    auto other = peer();
    queue(other, "a", 2);
    queue(other, "b", 3);
    queue(client, "c", 2);
    other.reset();
    wait_for([&] { return pool->load().queued == 1; });
    hold.open();
    client.line();
    client.line();
    BOOST_TEST(ran.joined() == "c");
    BOOST_TEST(pool->figures().withdrawn == 2U);
}

BOOST_FIXTURE_TEST_CASE(a_job_past_its_deadline_leaves_the_queue, fixture) {
    occupy();
    client.send("DELEGATE self:note/late id=2 deadline=20\n");
    BOOST_TEST(client.line().starts_with(R"(id=2 {"error":"deadline")"));
    wait_for([&] { return pool->load().queued == 0; });
    hold.open();
    client.line();
    BOOST_TEST(ran.size() == 0U);
}

// A job that runs until it is stopped, and records what it is notified of.
struct stoppable : fixture {
    stoppable() : fixture({.workers = 2}) {
        add("watchful", [this](const cles::responder& job) {
            job.on_stop([this] { ran.add("notified"); });
            ran.add("begun");
            while (!job.stopped()) {
                std::this_thread::sleep_for(1ms);
            }
            ran.add("stopped");
            job.done(cles::json_text{"1"}); // ignored
        });
    }
    void begin(scripted_peer& by, const std::string& adverbs) {
        by.send("DELEGATE self:watchful id=2" + adverbs + "\n");
        wait_for([&] { return ran.has("begun"); });
    }
    void check() {
        wait_for([&] { return ran.has("notified") && ran.has("stopped"); });
        wait_for([&] { return pool->load().running == 0; });
        BOOST_TEST(ran.size() == 3U);
    }
};

BOOST_FIXTURE_TEST_CASE(a_running_job_is_notified_that_it_was_withdrawn, stoppable) {
    begin(client, "");
    client.send("PUSH self:cles/cancel/2 id=10\n");
    BOOST_TEST(client.line().starts_with(R"(id=2 {"error":"cancelled")"));
    check();
}

BOOST_FIXTURE_TEST_CASE(a_running_job_is_notified_that_its_link_was_lost, stoppable) {
    begin(client, "");
    client.reset();
    check();
}

BOOST_FIXTURE_TEST_CASE(a_running_job_is_notified_of_its_deadline, stoppable) {
    begin(client, " deadline=20");
    BOOST_TEST(client.line().starts_with(R"(id=2 {"error":"deadline")"));
    check();
}

BOOST_FIXTURE_TEST_CASE(on_stop_of_a_stopped_job_calls_at_once, fixture) {
    add("late", [this](const cles::responder& job) {
        while (!job.stopped()) {
            std::this_thread::sleep_for(1ms);
        }
        const auto here = std::this_thread::get_id();
        job.on_stop([&] { ran.add(here == std::this_thread::get_id() ? "here" : "elsewhere"); });
        ran.add("after");
    });
    client.send("DELEGATE self:late id=2 deadline=10\n");
    client.line();
    wait_for([&] { return ran.size() == 2; });
    BOOST_TEST(ran.joined() == "here after");
}

BOOST_AUTO_TEST_SUITE_END()
