// SPDX-License-Identifier: BSL-1.0
// Jobs that send requests to other nodes, and hold no worker while they wait.

#include "jobs/job_pool.hpp"
#include "pooled_node.hpp"

#include <boost/test/unit_test.hpp>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

BOOST_AUTO_TEST_SUITE(delegated_requests)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;

// Two nodes that know each other, with one worker each.
struct fixture {
    fixture() {
        left.car.set_peer("right", right.endpoints().front());
        right.set_peer("car1", left.car.endpoints().front());
        right_pool = std::make_unique<cles::runtime::job_pool>(right, cles::runtime::pool_options{.workers = 1});
        right_tasks = std::make_unique<cles::runtime::pooled_registrar>(right, *right_pool);
    }

    pooled_node left{{.workers = 1, .queue = 64}};
    cles::service right{left.io, listening("right")};
    std::unique_ptr<cles::runtime::job_pool> right_pool;
    std::unique_ptr<cles::runtime::pooled_registrar> right_tasks;
};

// Asks the other node for one less, and adds one to its answer.
void count_down(const cles::request& r, cles::responder answer, const std::string& other) {
    const auto n = r.parameter<int>(0);
    if (n == 0) {
        answer.done(0);
        return;
    }
    answer.delegate("DELEGATE " + other + ":down/" + std::to_string(n - 1),
                    [answer](boost::system::error_code code, std::string_view json, std::string_view why) mutable {
                        if (code) {
                            answer.fail(static_cast<errc>(code.value()), why);
                        } else {
                            answer.done(1 + cles::from_json<std::map<std::string, int>>(json).at("value"));
                        }
                    });
}

BOOST_FIXTURE_TEST_CASE(jobs_that_delegate_to_each_other_on_full_pools_do_not_deadlock, fixture) {
    left.tasks->on_delegate("down",
                            [](const cles::request& r, cles::responder a) { count_down(r, std::move(a), "right"); });
    right_tasks->on_delegate("down",
                             [](const cles::request& r, cles::responder a) { count_down(r, std::move(a), "car1"); });
    auto client = left.peer();
    std::string lines;
    constexpr int jobs = 32;
    for (int i = 1; i <= jobs; ++i) {
        lines += "DELEGATE self:down/10 id=" + std::to_string(i) + "\n";
    }
    client.send(lines);
    for (int i = 0; i < jobs; ++i) {
        const auto line = client.line();
        BOOST_TEST(line.ends_with(R"({"value":10})"), line);
    }
}

BOOST_FIXTURE_TEST_CASE(a_callback_runs_on_a_worker_and_not_beside_its_job, fixture) {
    right_tasks->on_pull("quick", [] { return 1; });
    notes order;
    std::atomic<bool> on_io{false};
    const auto io_thread = std::this_thread::get_id();
    left.add("asking", [&](const cles::responder& job) {
        const auto inside = std::make_shared<std::atomic<int>>(1);
        const auto left_to_come = std::make_shared<std::atomic<int>>(3);
        for (int i = 0; i < 3; ++i) {
            job.delegate("PULL right:quick", {}, [&, job, inside, left_to_come](auto code, auto json, auto) {
                on_io = on_io || std::this_thread::get_id() == io_thread;
                order.add(code || json != R"({"value":1})" ? "wrong" : ++*inside == 1 ? "alone" : "together");
                --*inside;
                if (--*left_to_come == 0) {
                    job.done();
                }
            });
        }
        std::this_thread::sleep_for(20ms); // long enough for the answers to arrive
        order.add("begun");
        --*inside;
    });
    BOOST_TEST(left.peer().ask("DELEGATE self:asking") == "{}");
    BOOST_TEST(order.joined() == "begun alone alone alone");
    BOOST_TEST(!on_io);
}

BOOST_FIXTURE_TEST_CASE(an_exception_from_a_callback_is_the_answer, fixture) {
    left.add("asking", [](const cles::responder& job) {
        job.delegate("PULL right:nothing", {}, [job](boost::system::error_code code, auto, auto why) {
            throw cles::error(code, std::string{why});
        });
    });
    BOOST_TEST(left.peer().ask("DELEGATE self:asking") ==
               R"({"error":"no_task","message":"car1: right has no PULL 'nothing'","ran":true})");
}

BOOST_FIXTURE_TEST_CASE(a_job_whose_callback_does_not_answer_fails, fixture) {
    left.add("asking",
             [](const cles::responder& job) { job.delegate("PULL right:nothing", {}, [](auto, auto, auto) {}); });
    BOOST_TEST(left.peer().ask("DELEGATE self:asking") ==
               R"({"error":"failed","message":"car1: the job ended without an answer"})");
}

BOOST_FIXTURE_TEST_CASE(requests_of_a_withdrawn_job_are_withdrawn, fixture) {
    std::vector<cles::responder> kept;
    right.on_delegate("never", [&](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
    notes answers;
    left.add("asking", [&](const cles::responder& job) {
        job.delegate("DELEGATE right:never", {}, [&answers, job](boost::system::error_code code, auto, auto) {
            answers.add(code == errc::cancelled ? "cancelled" : code.message());
        });
    });
    auto client = left.peer();
    client.send("DELEGATE self:asking id=1\n");
    left.wait_for([&] { return kept.size() == 1; });
    client.send("PUSH self:cles/cancel/1 id=2\n");
    BOOST_TEST(client.line().starts_with(R"(id=1 {"error":"cancelled")"));
    left.wait_for([&] { return kept.front().stopped() && answers.size() == 1; });
    BOOST_TEST(answers.joined() == "cancelled");
    left.wait_for([&] { return left.pool->load().running == 0; });
}

BOOST_FIXTURE_TEST_CASE(requests_of_a_stopped_job_are_cancelled, fixture) {
    notes answers;
    left.add("late", [&](const cles::responder& job) {
        while (!job.stopped()) {
            std::this_thread::sleep_for(1ms);
        }
        job.delegate("PULL right:nothing", {}, [&answers, job](boost::system::error_code code, auto, auto) {
            answers.add(code == errc::cancelled ? "cancelled" : code.message());
        });
    });
    auto client = left.peer();
    client.ask("DELEGATE self:late deadline=10 id=1");
    left.wait_for([&] { return answers.size() == 1; });
    BOOST_TEST(answers.joined() == "cancelled");
}

BOOST_FIXTURE_TEST_CASE(progress_of_a_request_reaches_the_job, fixture) {
    right_tasks->on_delegate("slow", [](const cles::request&, const cles::responder& job) {
        job.progress(0.5);
        job.done();
    });
    notes answers;
    left.add("asking", [&](const cles::responder& job) {
        const auto options = cles::call_options{}.on_progress(
            [&answers](double at, std::string_view) { answers.add(at == 0.5 ? "half" : "else"); });
        job.delegate("DELEGATE right:slow", options, [&answers, job](auto, auto, auto) {
            answers.add("done");
            job.done();
        });
    });
    BOOST_TEST(left.peer().ask("DELEGATE self:asking") == "{}");
    BOOST_TEST(answers.joined() == "half done");
}

// What the callbacks of jobs received, and where.
struct ending : fixture {
    ending() {
        right.on_delegate("never", [this](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
        left.add("asking", [this](const cles::responder& job) {
            job.delegate("DELEGATE right:never", {}, [this, job](boost::system::error_code code, auto, auto) {
                answers.add(std::string{cles::wire_name(static_cast<errc>(code.value()))} +
                            (std::this_thread::get_id() == io_thread ? " in line" : ""));
                job.done();
            });
            asked.add("once");
        });
    }
    void end_pool() {
        left.tasks.reset();
        left.pool.reset();
    }

    std::thread::id io_thread = std::this_thread::get_id();
    std::vector<cles::responder> kept;
    notes asked;
    notes answers;
};

BOOST_FIXTURE_TEST_CASE(closing_the_pool_completes_open_requests, ending) {
    auto client = left.peer();
    client.send("DELEGATE self:asking id=1\n");
    left.wait_for([&] { return kept.size() == 1; });
    end_pool();
    BOOST_TEST(answers.joined() == "unavailable");
    BOOST_TEST(client.line().starts_with(R"(id=1 {"error":"unavailable")"));
    run_ready(left.io);
    BOOST_TEST(answers.joined() == "unavailable"); // once
}

BOOST_FIXTURE_TEST_CASE(closing_the_pool_completes_unsent_requests, ending) {
    auto client = left.peer();
    client.send("DELEGATE self:asking id=1\n");
    left.wait_for([&] { return left.pool->figures().admitted == 1; });
    while (asked.size() == 0) { // the executor does not run
        std::this_thread::yield();
    }
    end_pool();
    BOOST_TEST(answers.joined() == "cancelled");
    run_ready(left.io);
    BOOST_TEST(kept.empty());
}

BOOST_FIXTURE_TEST_CASE(at_the_limit_of_a_drain_free_workers_run_callbacks, ending) {
    auto client = left.peer();
    client.send("DELEGATE self:asking id=1\n");
    left.wait_for([&] { return kept.size() == 1; });
    bool drained = false;
    left.pool->drain(1ms, [&](const cles::runtime::drain_report& how) { drained = how.abandoned == 1; });
    left.wait_for([&] { return drained; });
    end_pool();
    BOOST_TEST(answers.size() == 1U); // by the end, or because its request was withdrawn
    BOOST_TEST(!answers.has("in line"));
}

BOOST_FIXTURE_TEST_CASE(a_callback_runs_when_its_job_returns_after_the_end, ending) {
    const auto hold = left.held_;
    const auto late = std::make_shared<notes>();
    left.add("holding", [hold, late](const cles::responder& job) {
        job.delegate("DELEGATE right:never", {}, [late](boost::system::error_code code, auto, auto) {
            late->add(std::string{cles::wire_name(static_cast<errc>(code.value()))});
        });
        hold->pass();
    });
    auto client = left.peer();
    client.send("DELEGATE self:holding id=1\n");
    left.wait_for([&] { return kept.size() == 1; });
    bool drained = false;
    left.pool->drain(0ms, [&](const cles::runtime::drain_report& how) { drained = how.stuck == 1; });
    left.wait_for([&] { return drained; });
    end_pool();
    BOOST_TEST(late->size() == 0U);
    hold->open();
    while (late->size() == 0) {
        std::this_thread::yield();
    }
    BOOST_TEST((late->joined() == "unavailable" || late->joined() == "cancelled"), late->joined());
}

BOOST_AUTO_TEST_SUITE_END()
