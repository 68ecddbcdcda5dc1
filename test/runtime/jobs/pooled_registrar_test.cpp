// SPDX-License-Identifier: BSL-1.0
#include "jobs/pooled_registrar.hpp"
#include "pooled_node.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/test/unit_test.hpp>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

namespace pooled_registrar {
namespace {

// Written by its converter with white space, which only a further check would remove.
struct spaced {};

} // namespace
} // namespace pooled_registrar

template <>
struct cles::converter<pooled_registrar::spaced> {
    static void write(json_writer& w, const pooled_registrar::spaced&) { w.raw(R"({"a": [1, 2]})"); }
};

BOOST_AUTO_TEST_SUITE(pooled_registrar)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;

struct fixture : pooled_node {
    fixture() : pooled_node({.workers = 2, .slow_inline = 1ms}), client(peer()) {}
    std::string here() const { return std::this_thread::get_id() == main ? "in line" : "on a worker"; }
    std::string ask(const std::string& line) { return client.ask(line); }

    std::thread::id main = std::this_thread::get_id();
    scripted_peer client;
};

BOOST_FIXTURE_TEST_CASE(every_kind_of_handler_runs_on_a_worker, fixture) {
    tasks->on_pull("plain", [this] { return here(); });
    tasks->on_push("plain", [this](const cles::request&, int) { return here(); });
    tasks->on_delegate("later", [this](const cles::request&, cles::responder answer) { answer.done(here()); });
    BOOST_TEST(ask("PULL self:plain") == R"({"value":"on a worker"})");
    BOOST_TEST(ask("PUSH self:plain {\"value\":1}") == R"({"value":"on a worker"})");
    BOOST_TEST(ask("DELEGATE self:later") == R"({"value":"on a worker"})");
}

BOOST_FIXTURE_TEST_CASE(inline_handlers_run_inline_and_are_counted, fixture) {
    tasks->on_pull("plain", [this] { return here(); }, {.inline_ok = true});
    tasks->on_pull("later", [this](const cles::request&, cles::responder answer) { answer.done(here()); },
                   {.inline_ok = true});
    BOOST_TEST(ask("PULL self:plain") == R"({"value":"in line"})");
    BOOST_TEST(ask("PULL self:later") == R"({"value":"in line"})");
    BOOST_TEST(pool->figures().inline_calls == 2U);
    BOOST_TEST(pool->figures().admitted == 0U);
}

BOOST_FIXTURE_TEST_CASE(slow_inline_handlers_are_logged, fixture) {
    tasks->on_pull("slow",
                   [] {
                       std::this_thread::sleep_for(2ms);
                       throw cles::error(errc::failed, "and it failed");
                   },
                   {.inline_ok = true});
    BOOST_TEST(ask("PULL self:slow") == R"({"error":"failed","message":"car1: and it failed"})");
    const auto figures = pool->figures();
    BOOST_TEST(figures.inline_slow == 1U);
    BOOST_TEST(figures.inline_worst_us >= 2000U);
    BOOST_TEST(log.has("the task 'slow' blocked the node for "));
}

boost::asio::awaitable<std::string> tell(const fixture& node) { co_return node.here(); }

BOOST_FIXTURE_TEST_CASE(a_coroutine_runs_on_the_services_executor, fixture) {
    tasks->on_pull("coroutine", [this]() -> boost::asio::awaitable<std::string> { return tell(*this); });
    BOOST_TEST(ask("PULL self:coroutine") == R"({"value":"in line"})");
}

BOOST_FIXTURE_TEST_CASE(a_bind_handler_runs_on_a_worker_unless_inline, fixture) {
    notes where;
    const auto decide = [&](const cles::request& r) {
        where.add(here());
        if (r.parameters().empty()) {
            throw cles::error(errc::bad_request, "which one?");
        }
    };
    tasks->on_bind("place", decide);
    tasks->on_bind("quick", decide, {.inline_ok = true});
    tasks->on_bind("open");
    BOOST_TEST(ask("BIND self:place") == R"({"error":"bad_request","message":"car1: which one?"})");
    BOOST_TEST(ask("BIND self:place/fast") == "{}");
    BOOST_TEST(ask("BIND self:quick").starts_with(R"({"error":"bad_request")"));
    BOOST_TEST(ask("BIND self:quick/fast") == "{}");
    BOOST_TEST(ask("BIND self:open") == "{}");
    BOOST_TEST(where.joined() == "on a worker on a worker in line in line");
}

BOOST_FIXTURE_TEST_CASE(a_hanging_bind_handler_delays_no_other, fixture) {
    tasks->on_bind("slow", [gate = held_](const cles::request&) { gate->pass(); });
    tasks->on_pull("quick", [] { return 1; });
    client.send("BIND self:slow id=1\nPULL self:quick id=2\n");
    BOOST_TEST(client.line() == R"(id=2 {"value":1})");
    wait_for([&] { return hold.arrived() == 1; });
    car.update("slow", 7);
    hold.open();
    BOOST_TEST(client.line() == R"(id=1 {"value":7})"); // the last update
    car.update("slow", 8);
    const auto update = client.line();
    BOOST_TEST(update.starts_with("UPDATE car1:slow seq=2 "), update);
}

BOOST_FIXTURE_TEST_CASE(a_request_to_publish_is_published_after_its_handler, fixture) {
    tasks->on_update("notice", [this](const cles::request& r) {
        if (here() != "on a worker" || r.body() == "{}") {
            throw cles::error(errc::bad_request, "say something");
        }
    });
    BOOST_TEST(ask("BIND self:notice") == "{}");
    BOOST_TEST(ask("UPDATE self:notice") == R"({"error":"bad_request","message":"car1: say something"})");
    client.send("UPDATE self:notice {\"text\":1}\n");
    const auto first = client.line();
    const auto second = client.line();
    const auto both = first + second;
    BOOST_TEST(both.find("UPDATE car1:notice seq=1 ") != std::string::npos, both);
    BOOST_TEST(both.find(R"({"text":1})") != std::string::npos, both);
}

BOOST_FIXTURE_TEST_CASE(a_handler_does_not_run_with_an_invalid_body, fixture) {
    std::atomic<int> ran{0};
    tasks->on_push("speed", [&](int) { ++ran; });
    BOOST_TEST(ask("PUSH self:speed {\"value\":\"x\"}").starts_with(R"({"error":"bad_request")"));
    BOOST_TEST(ran == 0);
}

BOOST_FIXTURE_TEST_CASE(a_result_is_checked_where_it_is_written_and_not_again, fixture) {
    const auto answer_spaced = [](const cles::request&, cles::responder answer) { answer.done(spaced{}); };
    tasks->on_delegate("inline", answer_spaced, {.inline_ok = true});
    tasks->on_delegate("pooled", answer_spaced);
    tasks->on_delegate(
        "text", [](const cles::request&, cles::responder answer) { answer.done(cles::json_text{R"({"a": [1, 2]})"}); });
    tasks->on_delegate("reports", [](const cles::request&, cles::responder answer) {
        answer.progress(0.5, spaced{});
        answer.done();
    });
    BOOST_TEST(ask("DELEGATE self:inline") == R"({"a": [1, 2]})");
    BOOST_TEST(ask("DELEGATE self:pooled") == R"({"a": [1, 2]})");
    BOOST_TEST(ask("DELEGATE self:text") == R"({"a":[1,2]})");
    const auto report = ask("DELEGATE self:reports id=1 progress=yes");
    BOOST_TEST(report.ends_with(R"({"a": [1, 2]})"), report);
}

BOOST_FIXTURE_TEST_CASE(a_task_is_registered_once, fixture) {
    tasks->on_pull("speed", [] { return 1; });
    BOOST_CHECK_EXCEPTION(tasks->on_pull("speed", [] { return 2; }), cles::error,
                          [](const cles::error& e) { return e.code() == errc::already_registered; });
}

BOOST_FIXTURE_TEST_CASE(a_job_that_publishes_may_do_so_from_its_worker, fixture) {
    const auto publisher = tasks->make_publisher();
    tasks->on_bind("news");
    tasks->on_push("news", [publisher](int n) { publisher.update("news", n); });
    BOOST_TEST(ask("BIND self:news") == "{}");
    client.send("PUSH self:news {\"value\":5}\n");
    const auto both = client.line() + client.line();
    BOOST_TEST(both.find("UPDATE car1:news seq=1 ") != std::string::npos, both);
}

BOOST_AUTO_TEST_SUITE_END()
