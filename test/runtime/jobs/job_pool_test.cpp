// SPDX-License-Identifier: BSL-1.0
// Jobs on real threads, and how they end.

#include "jobs/job_pool.hpp"
#include "pooled_node.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <atomic>
#include <cstdint>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(job_pool)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;
using cles::json_text;
using cles::responder;

struct fixture : pooled_node {
    fixture() : client(peer()) {}
    std::string ask(const std::string& line) { return client.ask(line); }

    scripted_peer client;
};

BOOST_FIXTURE_TEST_CASE(a_job_runs_on_a_worker_with_its_request, fixture) {
    notes seen;
    std::atomic<std::thread::id> where{};
    tasks->on_delegate("route", [&](const cles::request& r, const responder& job) {
        where = std::this_thread::get_id();
        seen.add(std::string{r.node()} + " " + std::string{r.task()} + " " + std::string{r.parameter(0)} + " " +
                 std::string{r.body()} + " " + r.peer().transport);
        seen.add(r.deadline() > cles::time_point::clock::now() ? "in time" : "late");
        job.done(json_text{R"({"km":3})"});
    });
    BOOST_TEST(ask(R"(DELEGATE self:route/fast {"to":"x"})") == R"({"km":3})");
    BOOST_TEST(seen.joined() == R"(car1 route fast {"to":"x"} tcp in time)");
    BOOST_TEST((where.load() != std::this_thread::get_id()));
    BOOST_TEST(pool->figures().admitted == 1U);
    BOOST_TEST(pool->figures().answered == 1U);
}

BOOST_FIXTURE_TEST_CASE(results_are_the_same_as_inline, fixture) {
    add("nothing", [](const responder& job) { job.done(); });
    add("scalar", [](const responder& job) { job.done(json_text{"42"}); });
    add("spaced", [](const responder& job) { job.done(json_text{"{ \"a\" : [ 1,\n2 ] }"}); });
    add("broken", [](const responder& job) { job.done(json_text{"{\"a\":"}); });
    add("error", [](const responder& job) { job.done(json_text{R"({"error":"mine"})"}); });
    add("refusing", [](const responder& job) { job.fail(errc::denied, "not you"); });
    BOOST_TEST(ask("DELEGATE self:nothing") == "{}");
    BOOST_TEST(ask("DELEGATE self:scalar") == R"({"value":42})");
    BOOST_TEST(ask("DELEGATE self:spaced") == R"({"a":[1,2]})");
    BOOST_TEST(ask("DELEGATE self:broken").starts_with(R"({"error":"failed")"));
    BOOST_TEST(ask("DELEGATE self:error").starts_with(R"({"error":"failed")"));
    BOOST_TEST(ask("DELEGATE self:refusing") == R"({"error":"denied","message":"car1: not you"})");
}

namespace {

/// A requester that keeps the callback with which its withdrawal is reported.
class late_withdrawal final : public cles::detail::call_control {
  public:
    explicit late_withdrawal(std::string& outcome) : outcome_(outcome) {}
    void done(std::string_view json) override { outcome_ = json; }
    void fail(errc, std::string_view message) override { outcome_ = message; }
    bool progress(double, std::string_view) override { return false; }
    void on_stop(std::function<void()> callback) override { withdraw = std::move(callback); }
    [[nodiscard]] bool stopped() const noexcept override { return false; }
    void delegate(std::string_view, const cles::call_options&, cles::answer_callback) override {}
    void log(cles::log_level, std::string_view) override {}

    std::function<void()> withdraw;

  private:
    std::string& outcome_;
};

} // namespace

BOOST_FIXTURE_TEST_CASE(a_withdrawal_reported_after_the_job_has_ended_concerns_no_other_job, fixture) {
    cles::detail::request_data data{.verb = cles::verb::delegate, .node = "car1", .task = "held", .parameters = {}};
    const cles::identity somebody{
        .transport = "tcp", .address = "tcp://127.0.0.1:1", .name = "", .uid = std::nullopt, .local = true};
    data.peer = &somebody;
    const auto work = [](std::shared_ptr<gate> behind) {
        return std::make_shared<const cles::registration>(
            cles::registration{.plain = [behind](const cles::request&, cles::json_writer& w) {
                if (behind) {
                    behind->pass();
                }
                w.raw("{}");
            }});
    };
    std::string first;
    std::string second;
    const auto early = std::make_shared<late_withdrawal>(first);
    pool->dispatcher()->submit(cles::request{data}, responder{early}, work(nullptr));
    wait_for([&] { return !first.empty(); });
    io.poll(); // the job has been released
    pool->dispatcher()->submit(cles::request{data}, responder{std::make_shared<late_withdrawal>(second)}, work(held_));
    early->withdraw();
    hold.open();
    wait_for([&] { return !second.empty(); });
    BOOST_TEST(second == "{}");
    BOOST_TEST(pool->figures().withdrawn == 0U);
}

namespace {

/// Counts what the pool reports.
class counting_sharing final : public cles::job_sharing {
  public:
    explicit counting_sharing(int& changes) : changes_(changes) {}
    [[nodiscard]] bool may_move(const cles::core::call&) const noexcept override { return true; }
    void on_change() override { ++changes_; }
    void withdraw(std::uint64_t) override {}

  private:
    int& changes_;
};

} // namespace

BOOST_AUTO_TEST_CASE(jobs_that_arrive_together_are_reported_together) {
    constexpr int count = 60;
    int changes = 0;
    pooled_node node{{.workers = 1}};
    node.pool->dispatcher()->share(std::make_unique<counting_sharing>(changes));
    node.add_held();
    auto client = node.peer();
    client.send("DELEGATE self:held id=1\n"); // holds the worker
    node.wait_for([&] { return node.pool->load().running == 1; });
    run_ready(node.io);
    const auto before = changes;
    std::string lines;
    for (int i = 0; i < count; ++i) {
        lines += "DELEGATE self:held id=" + std::to_string(i + 2) + "\n";
    }
    client.send(lines);
    node.wait_for([&] { return node.pool->load().queued == count; });
    node.io.poll();
    BOOST_TEST(changes != before);
    BOOST_TEST(changes - before < count / 4); // the pool's timer reports, too
}

BOOST_AUTO_TEST_CASE(the_pool_may_end_before_the_end_of_a_burst_is_reported) {
    int changes = 0;
    auto node = std::make_unique<pooled_node>(cles::runtime::pool_options{.workers = 1});
    node->pool->dispatcher()->share(std::make_unique<counting_sharing>(changes));
    std::array<std::string, 2> outcomes;
    cles::detail::request_data data{.verb = cles::verb::delegate, .node = "car1", .task = "work", .parameters = {}};
    const cles::identity somebody{
        .transport = "tcp", .address = "tcp://127.0.0.1:1", .name = "", .uid = std::nullopt, .local = true};
    data.peer = &somebody;
    const auto work = std::make_shared<const cles::registration>(
        cles::registration{.plain = [](const cles::request&, cles::json_writer& w) { w.raw("{}"); }});
    for (auto& each : outcomes) {
        node->pool->dispatcher()->submit(cles::request{data}, responder{std::make_shared<late_withdrawal>(each)}, work);
    }
    node->pool->close(5s);
    const auto before = changes;
    run_ready(node->io);
    BOOST_TEST(changes == before);
    for (const auto& each : outcomes) {
        BOOST_TEST(!each.empty());
    }
}

BOOST_FIXTURE_TEST_CASE(a_job_may_refuse_with_a_retry_delay, fixture) {
    add("full", [](const responder& job) { job.refuse("no room in the dock", 250ms); });
    tasks->on_delegate("full_too", [](const cles::request&, const cles::responder& answer) {
        answer.refuse("no room here either", 7s);
    });
    BOOST_TEST(ask("DELEGATE self:full") == R"({"error":"busy","message":"car1: no room in the dock","retry_ms":250})");
    BOOST_TEST(ask("DELEGATE self:full_too") ==
               R"({"error":"busy","message":"car1: no room here either","retry_ms":7000})");
    add("good", [](const responder& job) { job.fail(errc::busy, "in its own words"); });
    BOOST_TEST(ask("DELEGATE self:good").find("retry_ms\":7000") ==
               std::string::npos); // nothing is left of the earlier one
}

BOOST_FIXTURE_TEST_CASE(an_exception_from_a_job_becomes_the_answer, fixture) {
    add("own", [](const responder&) { throw cles::error(errc::bad_request, "no such place"); });
    add("standard", [](const responder&) { throw std::runtime_error("cannot open /etc/secret/key.pem"); });
    add("number", [](const responder&) { throw 7; });
    add("good", [](const responder& job) { job.done(json_text{"1"}); });
    BOOST_TEST(ask("DELEGATE self:own") == R"({"error":"bad_request","message":"car1: no such place"})");
    const auto standard = ask("DELEGATE self:standard");
    BOOST_TEST(standard.starts_with(R"({"error":"failed")"), standard);
    BOOST_TEST(standard.find("secret") == std::string::npos, standard);
    BOOST_TEST(ask("DELEGATE self:number").starts_with(R"({"error":"failed")"));
    BOOST_TEST(ask("DELEGATE self:good") == R"({"value":1})");
    BOOST_TEST(pool->figures().threw == 3U);
}

BOOST_FIXTURE_TEST_CASE(the_first_answer_is_sent_and_others_are_counted, fixture) {
    add("twice", [](const responder& job) {
        job.done(json_text{"1"});
        job.done(json_text{"2"});
        job.fail(errc::failed, "three");
        throw std::runtime_error("four");
    });
    BOOST_TEST(ask("DELEGATE self:twice") == R"({"value":1})");
    wait_for([&] { return pool->figures().answered_twice == 3; });
}

BOOST_FIXTURE_TEST_CASE(concurrent_answers_send_one, fixture) {
    add("race", [](const responder& job) {
        std::vector<std::thread> racers;
        for (int i = 0; i < 4; ++i) {
            racers.emplace_back([job, i] { job.done(json_text{std::to_string(i)}); });
        }
        for (auto& each : racers) {
            each.join();
        }
    });
    for (int i = 0; i < 20; ++i) {
        BOOST_TEST(ask("DELEGATE self:race").starts_with(R"({"value":)"));
    }
    wait_for([&] { return pool->figures().answered_twice == 60; }); // the last ones may not have arrived
}

BOOST_FIXTURE_TEST_CASE(a_released_job_without_an_answer_fails, fixture) {
    add("forgotten", [](const responder&) {});
    BOOST_TEST(ask("DELEGATE self:forgotten") ==
               R"({"error":"failed","message":"car1: the job ended without an answer"})");
    BOOST_TEST(pool->figures().answerless == 1U);
}

BOOST_FIXTURE_TEST_CASE(a_job_may_be_answered_later_by_a_thread_of_its_own, fixture) {
    std::vector<std::thread> own;
    std::mutex guard;
    add("later", [&](const responder& job) {
        const std::lock_guard lock{guard};
        own.emplace_back([job] { job.done(json_text{"[5]"}); });
    });
    BOOST_TEST(ask("DELEGATE self:later") == "[5]");
    wait_for([&] { return pool->load().running == 0; }); // its worker has released it
    const std::lock_guard lock{guard};
    own.front().join();
}

BOOST_FIXTURE_TEST_CASE(a_job_that_waits_holds_no_worker, fixture) {
    notes order;
    std::mutex guard;
    std::vector<responder> kept;
    add("waiting", [&](const responder& job) {
        const std::lock_guard lock{guard};
        kept.push_back(job);
    });
    add("quick", [](const responder& job) { job.done(); });
    client.send("DELEGATE self:waiting id=1\nDELEGATE self:waiting id=2\nDELEGATE self:waiting id=3\n");
    BOOST_TEST(ask("DELEGATE self:quick id=9") == "id=9 {}");
    wait_for([&] { return pool->figures().waiting == 3; });
    BOOST_TEST(pool->load().running == 3U);
    const std::lock_guard lock{guard};
    for (const auto& each : kept) {
        each.done();
    }
    client.line();
    client.line();
    client.line();
    kept.clear();
    wait_for([&] { return pool->load().running == 0; });
}

BOOST_FIXTURE_TEST_CASE(a_job_may_answer_after_the_pool_is_destroyed, fixture) {
    std::optional<responder> kept;
    std::optional<cles::request> kept_request;
    std::promise<void> handed_over;
    tasks->on_delegate("later", [&](const cles::request& r, const responder& job) {
        kept = job;
        kept_request = r;
        handed_over.set_value();
    });
    client.send("DELEGATE self:later\n");
    wait_for([&, ready = handed_over.get_future()] { return ready.wait_for(0s) == std::future_status::ready; });
    tasks.reset();
    pool.reset();
    BOOST_TEST(client.line().starts_with(R"({"error":"unavailable")"));
    BOOST_TEST(ask("DELEGATE self:later").starts_with(R"({"error":"unavailable")"));
    BOOST_TEST(kept->stopped());
    notes events;
    std::thread{[&events, &kept_request, job = *std::exchange(kept, std::nullopt)] {
        events.add(job.progress(0.5) ? "wanted" : "unwanted");
        job.log(cles::log_level::info, "still here");
        job.done(json_text{"1"});
        job.done(json_text{"2"});
        events.add(std::string{kept_request->task()});
    }}.join();
    BOOST_TEST(events.joined() == "unwanted later");
    run_ready(io);
}

BOOST_AUTO_TEST_CASE(a_job_may_answer_after_the_service_is_destroyed) {
    std::optional<responder> kept;
    {
        fixture node;
        node.add("later", [&](const responder& job) { kept = job; });
        node.client.send("DELEGATE self:later\n");
        node.wait_for([&] { return node.pool->figures().waiting == 1; });
    }
    BOOST_TEST_REQUIRE(kept.has_value());
    std::thread{[job = *std::exchange(kept, std::nullopt)] { job.done(json_text{"1"}); }}.join();
}

BOOST_FIXTURE_TEST_CASE(progress_comes_in_order_before_the_result, fixture) {
    add("slow", [](const responder& job) {
        job.progress(0.25, json_text{R"({"at":1})"});
        job.progress(0.5);
        job.progress(0.1); // progress does not decrease
        job.done(json_text{"[]"});
    });
    client.send("DELEGATE self:slow id=7 progress=yes\n");
    BOOST_TEST(client.line() == R"(id=7 progress=0.25 {"at":1})");
    BOOST_TEST(client.line() == "id=7 progress=0.5 {}");
    BOOST_TEST(client.line() == "id=7 progress=0.5 {}");
    BOOST_TEST(client.line() == "id=7 []");
}

BOOST_FIXTURE_TEST_CASE(progress_reports_whether_it_is_wanted, fixture) {
    add("slow", [](const responder& job) {
        while (job.progress(0.5)) {
            std::this_thread::yield();
        }
        job.done();
    });
    BOOST_TEST(ask("DELEGATE self:slow id=7") == "id=7 {}");
}

BOOST_FIXTURE_TEST_CASE(memory_of_progress_reports_is_bounded, fixture) {
    add("talkative", [](const responder& job) {
        for (int i = 0; i < 10'000; ++i) {
            job.progress(i / 10'000.0);
        }
        job.done();
    });
    client.send("DELEGATE self:talkative id=7 progress=yes\n");
    std::string line;
    int reports = 0;
    for (line = client.line(); line.find("progress=") != std::string::npos; line = client.line()) {
        ++reports;
    }
    BOOST_TEST(line == "id=7 {}");
    BOOST_TEST(reports >= 1);
    BOOST_TEST(reports <= 10'000);
}

BOOST_FIXTURE_TEST_CASE(a_job_writes_to_the_log, fixture) {
    add("chatty", [](const responder& job) {
        job.log(cles::log_level::info, "on my way");
        job.done();
    });
    BOOST_TEST(ask("DELEGATE self:chatty") == "{}");
    wait_for([&] { return log.has("on my way"); });
}

BOOST_FIXTURE_TEST_CASE(a_hung_pull_delays_no_other, fixture) {
    tasks->on_pull("hung", [&] {
        hold.pass();
        return 0;
    });
    tasks->on_pull("quick", [] { return 1; });
    client.send("PULL self:hung id=1\n");
    wait_for([&] { return hold.arrived() == 1; });
    for (int i = 0; i < 100; ++i) {
        BOOST_TEST_REQUIRE(ask("PULL self:quick id=2") == R"(id=2 {"value":1})");
    }
    BOOST_TEST(hold.passed() == 0);
    hold.open();
    BOOST_TEST(client.line() == R"(id=1 {"value":0})");
}

BOOST_FIXTURE_TEST_CASE(many_jobs_of_many_links_are_all_answered, fixture) {
    std::atomic<int> ran{0};
    tasks->on_delegate("echo", [&](const cles::request& r, const responder& job) {
        ++ran;
        job.done(json_text{std::string{r.body()}});
    });
    tasks->on_delegate("plain", [&](const cles::request& r) {
        ++ran;
        return cles::json_text{std::string{r.body()}};
    });
    std::vector<scripted_peer> clients;
    constexpr int links = 5;
    constexpr int each = 200;
    for (int i = 0; i < links; ++i) {
        clients.push_back(peer());
        std::string lines;
        for (int n = 1; n <= each; ++n) {
            const std::string task = n % 2 == 0 ? "echo" : "plain";
            lines += "DELEGATE self:" + task + " id=" + std::to_string(n) + " [" + std::to_string(i * each + n) + "]\n";
        }
        clients.back().send(lines);
    }
    for (int i = 0; i < links; ++i) {
        std::vector<bool> seen(each + 1);
        for (int n = 0; n < each; ++n) {
            const auto line = clients[static_cast<std::size_t>(i)].line();
            const auto id = std::stoi(line.substr(3));
            BOOST_TEST_REQUIRE(line == "id=" + std::to_string(id) + " [" + std::to_string(i * each + id) + "]");
            BOOST_TEST_REQUIRE(!seen[static_cast<std::size_t>(id)]);
            seen[static_cast<std::size_t>(id)] = true;
        }
    }
    BOOST_TEST(ran == links * each);
    BOOST_TEST(pool->figures().answered == static_cast<std::uint64_t>(links * each));
    wait_for([&] { return pool->load().running == 0; });
    BOOST_TEST(pool->load().queued == 0U);
    BOOST_TEST(pool->load().workers == 2U);
}

BOOST_FIXTURE_TEST_CASE(load_contains_the_service_time, fixture) {
    add("slow", [](const responder& job) {
        std::this_thread::sleep_for(5ms);
        job.done(json_text{"1"});
    });
    BOOST_TEST(pool->load().service_us == 0U); // not known yet
    BOOST_TEST(ask("DELEGATE self:slow") == R"({"value":1})");
    wait_for([&] { return pool->load().running == 0; });
    BOOST_TEST(pool->load().service_us >= 5'000U);
}

BOOST_FIXTURE_TEST_CASE(load_grows_while_no_worker_is_free, fixture) {
    cles::test::gate open;
    add("quick", [](const responder& job) { job.done(json_text{"1"}); });
    add("waits", [&open](const responder& job) {
        open.pass();
        job.done(json_text{"1"});
    });
    ask("DELEGATE self:quick");
    auto one = peer();
    one.send("DELEGATE self:waits id=1\n");
    wait_for([&] { return pool->figures().running == 1; });
    std::this_thread::sleep_for(30ms);
    BOOST_TEST(pool->load().service_us < 30'000U); // the other worker is free
    one.send("DELEGATE self:waits id=2\n");
    wait_for([&] { return pool->figures().running == 2; });
    wait_for([&] { return pool->load().service_us >= 30'000U; });
    BOOST_TEST(pool->load().workers == 2U);
    open.open();
    one.line();
    one.line();
    for (int i = 0; i < 50; ++i) { // so that the average falls
        ask("DELEGATE self:quick");
    }
    BOOST_TEST(pool->load().service_us < 30'000U);
}

BOOST_AUTO_TEST_SUITE_END()
