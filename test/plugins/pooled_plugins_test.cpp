// SPDX-License-Identifier: BSL-1.0
// Plugins on a pool of workers, as in the daemon.
#include <cles/plugin_text.hpp>

#include "plugins/plugin_host.hpp"
#include "runtime/jobs/pooled_node.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

namespace pooled_plugins {
namespace {

using namespace cles::test;
using namespace std::chrono_literals;

struct fixture : pooled_node {
    explicit fixture(unsigned workers = 2) : pooled_node({.workers = workers}) {}
    void load(const std::string& plugin, const std::string& config = "{}") { host.load(plugin, config, *tasks); }

    // 99 of 100 requests take at most this long.
    std::chrono::nanoseconds p99(scripted_peer& client, const std::string& line) {
        constexpr std::size_t count = 500;
        std::vector<std::chrono::nanoseconds> took;
        for (std::size_t i = 0; i < count; ++i) {
            const auto begun = std::chrono::steady_clock::now();
            BOOST_REQUIRE(client.ask(line).starts_with(R"({"task":"show")"));
            took.push_back(std::chrono::steady_clock::now() - begun);
        }
        std::sort(took.begin(), took.end());
        return took[count * 99 / 100];
    }

    // Destroyed before the node and its pool.
    cles::runtime::plugin_host host{
        {.node = "car1", .rules = {.folders = {MADE_PLUGINS, PLUGINS}}, .log = {}, .trial = 0ms}};
};

struct one_worker : fixture {
    one_worker() : fixture(1) {}
};

} // namespace
} // namespace pooled_plugins

BOOST_FIXTURE_TEST_SUITE(pooled_plugins, fixture)

BOOST_AUTO_TEST_CASE(their_handlers_run_on_workers_unless_they_are_quick) {
    load("sound.so");
    auto client = peer();
    BOOST_TEST(client.ask("PULL self:number") == R"({"value":42})");
    BOOST_TEST(pool->figures().admitted == 1U);
    BOOST_TEST(client.ask("PULL self:parameters/abc") == R"({"value":3})");
    BOOST_TEST(pool->figures().admitted == 1U);
    BOOST_TEST(client.ask(R"(DELEGATE self:elsewhere {"a":1,"b":2})") == R"({"a":1,"b":2})");
    BOOST_TEST(client.ask("DELEGATE self:asks/pull") == R"({"value":42})");
    BOOST_TEST(client.ask("DELEGATE self:dropped_elsewhere").starts_with(R"({"error":"failed")"));
    BOOST_TEST(host.figures().jobs == 0U);
    BOOST_TEST(host.figures().answered_twice == 0U);
}

BOOST_FIXTURE_TEST_CASE(a_job_that_asks_others_leaves_the_only_worker_to_them, one_worker) {
    load("libcles-primes.so", R"({"parts_by":"self"})");
    auto client = peer();
    BOOST_TEST(client.ask(R"(DELEGATE self:primes_in_parts {"below":1000000,"parts":8})") ==
               R"({"count":78498,"largest":999983})");
}

BOOST_AUTO_TEST_CASE(a_pull_that_hangs_does_not_slow_another_task_down) {
    load("rough.so");
    auto client = peer();
    auto hung = peer();
    bool good = false;
    for (int attempt = 0; attempt < 10 && !good; ++attempt) { // other programs use this machine too
        const auto before = p99(client, "PULL self:show");
        hung.send("PULL self:hangs id=1 deadline=60000\n");
        const auto meanwhile = p99(client, "PULL self:show");
        good = meanwhile <= 2 * before;
        wait_for([&] { return pool->load().running == 1; }); // the last reply may have been first
        BOOST_TEST(client.ask("PUSH self:release") == "{}");
        BOOST_TEST(hung.line() == R"(id=1 {"value":"released"})");
    }
    BOOST_TEST(good);
}

BOOST_AUTO_TEST_CASE(a_bind_whose_handler_hangs_delays_no_other) {
    load("rough.so");
    auto binder = peer();
    auto other = peer();
    binder.send("BIND self:patient id=1 deadline=60000\n");
    wait_for([&] { return pool->load().running == 1; });
    BOOST_TEST(other.ask("PULL self:show").starts_with(R"({"task":"show")"));
    BOOST_TEST(binder.ask("BIND self:undecided id=2 deadline=20").starts_with(R"(id=2 {"error":"deadline")"));
    BOOST_TEST(binder.ask("BIND self:unwelcoming id=3") == R"(id=3 {"error":"denied","message":"car1: not you"})");
    BOOST_TEST(other.ask("PUSH self:release") == "{}");
    BOOST_TEST(binder.line() == "id=1 {}");
}

BOOST_AUTO_TEST_CASE(a_job_may_refuse_with_a_retry_time) {
    load("sound.so");
    BOOST_TEST(peer().ask("DELEGATE self:full") ==
               R"({"error":"busy","message":"car1: the dock is full","retry_ms":250})");
    BOOST_TEST(host.figures().jobs == 0U);
}

BOOST_AUTO_TEST_CASE(a_job_may_refuse_by_the_bare_entry_point_from_any_thread_and_once) {
    load("rough.so");
    BOOST_TEST(peer().ask("DELEGATE self:full") ==
               R"({"error":"busy","message":"car1: the dock is full","retry_ms":250})");
    wait_for([&] { return host.figures().answered_twice == 1; }); // the second attempt may still be in transit
}

BOOST_AUTO_TEST_CASE(an_answer_that_is_not_json_is_not_passed_on) {
    load("rough.so");
    BOOST_TEST(peer().ask("DELEGATE self:no_json") ==
               R"({"error":"failed","message":"car1: the plugin's answer is not JSON"})");
}

BOOST_AUTO_TEST_CASE(a_job_that_waits_for_others_is_notified_once_that_the_node_stops) {
    cles::service other{io, listening("other")};
    std::vector<cles::responder> kept;
    other.on_delegate("never", [&](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
    car.set_peer("other", other.endpoints().front());
    load("rough.so");
    auto client = peer();
    client.send("DELEGATE self:asks id=1\n");
    wait_for([&] { return kept.size() == 1; });
    tasks.reset();
    pool.reset();
    BOOST_TEST(client.line().starts_with(R"(id=1 {"error":"unavailable")"));
    run_ready(io);
    BOOST_TEST(client.ask("PULL self:told") == R"({"value":"unavailable"})");
}

BOOST_FIXTURE_TEST_CASE(a_job_follows_a_noun_and_leaves_the_only_worker_to_others, one_worker) {
    load("sound.so");
    int bound = 0;
    car.on_bind("height", [&](const cles::request&) { ++bound; });
    auto client = peer();
    auto other = peer();
    client.send("DELEGATE self:adds_up/self%3Aheight id=1\n");
    wait_for([&] { return bound == 1; });
    for (const int height : {4, 3, 2}) {
        car.update("height", height);
        BOOST_TEST(other.ask("PULL self:number") == R"({"value":42})");
    }
    car.update("height", 0);
    BOOST_TEST(client.line() == R"(id=1 {"value":9})");
    BOOST_TEST(host.figures().answered_twice == 0U);
}

BOOST_AUTO_TEST_CASE(a_job_is_told_why_it_cannot_bind) {
    load("sound.so");
    auto client = peer();
    BOOST_TEST(client.ask("DELEGATE self:adds_up/self%3Anothing").starts_with(R"({"error":"no_task")"));
    BOOST_TEST(client.ask("DELEGATE self:adds_up/nobody%3Aheight").starts_with(R"({"error":"no_target")"));
    BOOST_TEST(client.ask("DELEGATE self:adds_up_inline/self%3Anothing") ==
               R"({"error":"failed","message":"car1: a job on the I/O thread has no feeds"})");
}

BOOST_AUTO_TEST_CASE(a_feed_ends_with_its_job) {
    load("sound.so");
    int bound = 0;
    car.on_bind("height", [&](const cles::request&) { ++bound; });
    auto client = peer();
    client.send("DELEGATE self:adds_up/self%3Aheight id=1\n");
    wait_for([&] { return bound == 1; });
    client.send("PUSH self:cles/cancel/1 id=2\n");
    BOOST_TEST(client.line().starts_with(R"(id=1 {"error":"cancelled")"));
    wait_for([&] { return host.figures().jobs == 0 && pool->load().running == 0; });
}

BOOST_AUTO_TEST_CASE(a_job_binds_by_the_bare_entry_point_and_bad_handles_do_no_harm) {
    load("rough.so");
    car.update("known", 7);
    BOOST_TEST(peer().ask("DELEGATE self:binds") == R"({"value":true})");
    BOOST_TEST(host.figures().answered_twice == 0U);
}

BOOST_AUTO_TEST_CASE(callbacks_of_a_job_neither_run_beside_its_start_nor_beside_each_other) {
    load("rough.so");
    BOOST_TEST(peer().ask("DELEGATE self:takes_turns") == R"({"value":true})");
}

BOOST_AUTO_TEST_CASE(a_job_learns_which_update_the_value_of_its_feed_is) {
    load("rough.so");
    car.update("known", 7);
    car.update("known", 8);
    for (const auto* hops : {"[]", "[0]"}) {
        BOOST_TEST(peer().ask(std::string{"DELEGATE self:marks "} + hops) == "[2,true]");
    }
    const auto refused = peer().ask("DELEGATE self:marks [17]");
    BOOST_TEST(refused.starts_with(R"({"error":"failed")"));
    BOOST_TEST(refused.find("hops") != std::string::npos, refused);
    BOOST_TEST(cles::detail::hops_from(CLES_NO_HOPS) == 0U);
    BOOST_TEST(cles::detail::hops_from(cles::detail::abi_hops(3)) == 3U);
}

BOOST_AUTO_TEST_CASE(the_systems_nouns_are_pulled_and_bound) {
    load("libcles-system.so", R"({"interval_ms":10})");
    auto client = peer();
    for (const auto* noun : {"utc", "load", "memory", "disk", "network", "processes"}) {
        BOOST_TEST(client.ask(std::string{"PULL self:"} + noun).starts_with("{\""));
        BOOST_TEST(!client.ask(std::string{"PULL self:"} + noun).starts_with("{\"error"));
    }
    BOOST_TEST(client.ask("BIND self:memory") == "{}");
    BOOST_TEST(client.line().starts_with("UPDATE car1:memory seq=1 epoch="));
    BOOST_TEST(client.line().starts_with("UPDATE car1:memory seq=2 epoch="));
    BOOST_TEST(host.stop(20s).late.empty()); // its thread has ended
}

BOOST_AUTO_TEST_SUITE_END()
