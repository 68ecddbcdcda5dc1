// SPDX-License-Identifier: BSL-1.0
// Handlers that fail, that never complete, and that use the service which calls them.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/steady_timer.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

BOOST_AUTO_TEST_SUITE(handlers)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;

constexpr std::array carriers{carrier::tcp4, carrier::unix_file, carrier::inproc};

// Two services with a link between them.
struct nodes {
    explicit nodes(carrier kind = carrier::tcp4, const cles::limits& bounds = {})
        : car(std::make_unique<cles::service>(io, listening("car1", kind, bounds))), tower(io, knowing("tower", *car)) {
    }

    scripted_peer peer() { return {io, car->endpoints().front()}; }
    template <class T>
    void wait_for(const answer<T>& a) {
        run_until(io, [&] { return a.done(); });
    }

    asio::io_context io;
    std::unique_ptr<cles::service> car;
    cles::service tower;
};

void fail_in_some_way(const cles::request& r) {
    const auto way = r.parameter(0);
    if (way == "error") {
        throw cles::error(errc::busy, "not now");
    }
    if (way == "local") {
        throw cles::error(errc::would_deadlock, "inner matters");
    }
    if (way == "standard") {
        throw std::runtime_error("cannot open /etc/secret/key.pem: denied");
    }
    if (way == "system") {
        throw std::system_error(ENOENT, std::generic_category(), "/etc/secret/key.pem");
    }
    if (way == "boost") {
        throw boost::system::system_error(asio::error::connection_refused, "/etc/secret/key.pem");
    }
    throw 7;
}

asio::awaitable<void> fail_later(cles::request r) {
    asio::steady_timer pause{co_await asio::this_coro::executor, 1ms};
    co_await pause.async_wait(asio::use_awaitable);
    fail_in_some_way(r);
}

asio::awaitable<void> wait_for_ever() {
    asio::steady_timer never{co_await asio::this_coro::executor, asio::steady_timer::time_point::max()};
    co_await never.async_wait(asio::use_awaitable);
}

BOOST_AUTO_TEST_CASE(an_exception_from_a_handler_becomes_the_reply_and_names_no_file) {
    nodes n;
    n.car->on_pull("plain", [](const cles::request& r) { fail_in_some_way(r); });
    n.car->on_pull("coroutine", fail_later);
    n.car->on_pull("responder", [](const cles::request& r, cles::responder) { fail_in_some_way(r); });
    auto peer = n.peer();
    for (const std::string task : {"plain", "coroutine", "responder"}) {
        BOOST_TEST_CONTEXT(task) {
            const auto ask = [&](const char* way) { return peer.ask("PULL self:" + task + "/" + way); };
            BOOST_TEST(ask("error") == R"({"error":"busy","message":"car1: not now","retry_ms":100})");
            for (const auto* way : {"local", "standard", "system", "boost", "int"}) {
                const auto reply = ask(way);
                BOOST_TEST(reply.starts_with(R"({"error":"failed","message":")"), reply);
                BOOST_TEST(reply.find("secret") == std::string::npos, reply);
                BOOST_TEST(reply.find(".hpp") == std::string::npos, reply);
                BOOST_TEST(reply.find(".cpp") == std::string::npos, reply);
            }
        }
    }
}

BOOST_AUTO_TEST_CASE(a_bind_handler_may_refuse) {
    nodes n;
    n.car->on_bind("place", [](const cles::request& r) {
        if (r.parameter(0) != "fast") {
            throw cles::error(errc::bad_request, "only 'fast' is published");
        }
    });
    auto peer = n.peer();
    BOOST_TEST(peer.ask("BIND self:place/fast") == "{}");
    BOOST_TEST(peer.ask("BIND self:place/slow") ==
               R"({"error":"bad_request","message":"car1: only 'fast' is published"})");
    BOOST_TEST(peer.ask("BIND self:place").starts_with(R"({"error":"bad_request")"));
}

BOOST_AUTO_TEST_CASE(a_request_to_publish_that_its_handler_refuses_publishes_nothing) {
    nodes n;
    n.car->on_update("notice", [](const cles::request& r) {
        if (r.body() == "{}") {
            throw cles::error(errc::bad_request, "say something");
        }
    });
    auto peer = n.peer();
    BOOST_TEST(peer.ask("BIND self:notice") == "{}");
    BOOST_TEST(peer.ask("UPDATE self:notice") == R"({"error":"bad_request","message":"car1: say something"})");
    peer.send("UPDATE self:notice {\"text\":1}\n");
    const auto reply = peer.line();
    const auto update = peer.line();
    BOOST_TEST(reply == "{}");
    BOOST_TEST(update.starts_with("UPDATE car1:notice seq=1 "), update);
    BOOST_TEST(peer.ask("UPDATE self:notice {\"error\":\"x\"}").starts_with(R"({"error":"bad_request")"));
}

CLES_DATA_TEST_CASE(the_request_of_an_endless_handler_fails_at_its_deadline_and_it_is_told_to_stop, carriers, kind) {
    nodes n{kind};
    std::vector<cles::responder> kept;
    n.car->on_delegate("responder", [&](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
    n.car->on_delegate("coroutine", wait_for_ever);
    answer<> by_responder;
    answer<> by_coroutine;
    n.tower.async_request("DELEGATE car1:responder deadline=40", by_responder.options(), by_responder.take());
    n.tower.async_request("DELEGATE car1:coroutine deadline=40", by_coroutine.options(), by_coroutine.take());
    run_until(n.io, [&] { return by_responder.done() && by_coroutine.done(); });
    BOOST_TEST(by_responder.code == errc::deadline);
    BOOST_TEST(by_coroutine.code == errc::deadline);
    run_until(n.io, [&] { return kept.at(0).stopped(); });
    n.car.reset(); // destroyed while both still run
    kept.front().done();
    run_ready(n.io);
}

BOOST_AUTO_TEST_CASE(the_peer_is_notified_that_the_deadline_has_passed) {
    nodes n;
    n.car->on_delegate("coroutine", wait_for_ever);
    auto peer = n.peer();
    const auto reply = peer.ask("DELEGATE self:coroutine id=3 deadline=30");
    BOOST_TEST(reply == R"(id=3 {"error":"deadline","message":"car1 did not finish in time"})");
    peer.send("DELEGATE self:coroutine deadline=30\nPULL self:cles deadline=10000\n"); // the next one is served
    BOOST_TEST(peer.line().starts_with(R"({"error":"deadline")"));
    BOOST_TEST(peer.line().starts_with(R"({"node")"));
}

CLES_DATA_TEST_CASE(a_service_is_destroyed_while_its_handlers_still_run, carriers, kind) {
    nodes n{kind};
    std::vector<cles::responder> kept;
    n.car->on_delegate("responder", [&](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
    n.car->on_delegate("coroutine", wait_for_ever);
    answer<> one;
    answer<> two;
    n.tower.async_delegate("car1:responder", cles::json_text{}, one.take());
    n.tower.async_delegate("car1:coroutine", cles::json_text{}, two.take());
    run_until(n.io, [&] { return kept.size() == 1; });
    n.car.reset();
    run_until(n.io, [&] { return one.done() && two.done(); });
    BOOST_TEST(one.code == errc::unavailable);
    BOOST_TEST(two.code == errc::unavailable);
    BOOST_TEST(kept.front().stopped());
    bool told = false;
    kept.front().on_stop([&] { told = true; });
    BOOST_TEST(told); // at once, where it occurred
    kept.front().fail(errc::failed, "nobody hears this");
}

CLES_DATA_TEST_CASE(a_responder_that_is_dropped_has_failed_and_one_that_answers_twice_has_answered, carriers, kind) {
    nodes n{kind};
    n.car->on_pull("dropped", [](const cles::request&, const cles::responder&) {});
    n.car->on_pull("twice", [](const cles::request&, cles::responder r) {
        r.done(1);
        r.done(2);
        r.fail(errc::failed, "three");
    });
    answer<> dropped;
    answer<int> twice;
    n.tower.async_pull("car1:dropped", dropped.options(), dropped.take());
    n.tower.async_pull<int>("car1:twice", twice.take());
    run_until(n.io, [&] { return dropped.done() && twice.done(); });
    BOOST_TEST(dropped.code == errc::failed);
    BOOST_TEST(dropped.words == "car1: the handler ended without an answer");
    BOOST_TEST(twice.value == 1);
    BOOST_TEST(twice.calls == 1);
}

BOOST_AUTO_TEST_CASE(a_result_that_looks_like_a_failure_is_one) {
    nodes n;
    n.car->on_pull("sly", [] { return cles::json_text{R"({"error":"no_task"})"}; });
    n.car->on_pull("broken", [] { return cles::json_text{R"({"a":)"}; });
    auto peer = n.peer();
    BOOST_TEST(peer.ask("PULL self:sly").starts_with(R"({"error":"failed")"));
    BOOST_TEST(peer.ask("PULL self:broken").starts_with(R"({"error":"failed")"));
}

// -- handlers that use their own service ---------------------------------------------------------------------------

CLES_DATA_TEST_CASE(a_plain_handler_asks_back_on_the_same_link, carriers, kind) {
    nodes n{kind};
    n.tower.on_pull("name", [] { return "tower"; });
    answer<std::string> asked_back;
    n.car->on_push("hello", [&](const cles::request&) {
        n.car->set_peer("tower", n.car->endpoints().front()); // any URL will do: `self` is the node that reads it
        n.car->async_pull<std::string>("self:name", cles::call_options{}, asked_back.take());
        return 1;
    });
    n.car->on_pull("name", [] { return "car1"; });
    answer<int> a;
    n.tower.async_push<int>("car1:hello", cles::json_text{}, a.take());
    run_until(n.io, [&] { return a.done() && asked_back.done(); });
    BOOST_TEST(a.value == 1);
    BOOST_TEST(asked_back.value == "car1");
}

CLES_DATA_TEST_CASE(a_plain_handler_publishes_registers_and_asks_while_it_runs, carriers, kind) {
    nodes n{kind};
    feed_log feed;
    n.car->on_bind("log");
    feed.bind(n.tower, "car1:log");
    run_until(n.io, [&] { return feed.bound; });
    answer<> inner;
    n.car->on_pull("busy", [&](const cles::request& r) {
        n.car->update("log", std::string{r.task()});
        n.car->on_pull("later", [] { return 2; });
        n.car->async_pull("self:later", inner.take());
        n.car->update("log", std::string{r.body()});
        return std::string{r.task()};
    });
    answer<std::string> a;
    n.tower.async_pull<std::string>("car1:busy", a.take());
    run_until(n.io, [&] { return a.done() && inner.done() && feed.items.size() == 2; });
    BOOST_TEST(a.value == "busy");
    BOOST_TEST(inner.value.text == R"({"value":2})");
    BOOST_TEST((feed.bodies() == std::vector<std::string>{R"({"value":"busy"})", R"({"value":"{}"})"}));
}

CLES_DATA_TEST_CASE(a_plain_handler_may_stop_its_service, carriers, kind) {
    nodes n{kind};
    std::string seen;
    n.car->on_push("stop", [&](const cles::request& r) {
        n.car->stop();
        seen = std::string{r.body()} + std::string{r.task()} + std::string{r.parameter(0)};
        return 1;
    });
    answer<> first;
    answer<> second;
    n.tower.async_push("car1:stop/now", cles::json_text{R"({"why":"to see what happens"})"}, first.take());
    n.tower.async_push("car1:stop/now", cles::json_text{R"({"why":"again"})"}, second.take());
    run_until(n.io, [&] { return first.done() && second.done(); });
    BOOST_TEST(seen == R"({"why":"to see what happens"}stopnow)");
    BOOST_TEST(first.code == errc::unavailable); // its service was destroyed before it replied
    BOOST_TEST(second.code == errc::unavailable);
}

CLES_DATA_TEST_CASE(a_request_to_publish_may_stop_the_service, carriers, kind) {
    nodes n{kind};
    n.car->on_update("notice", [&](const cles::request&) { n.car->stop(); });
    answer<> a;
    n.tower.async_request(R"(UPDATE car1:notice {"text":"stop, will you"})", a.take());
    run_until(n.io, [&] { return a.done(); });
    BOOST_TEST(a.code == errc::unavailable);
}

BOOST_AUTO_TEST_CASE(a_plain_handler_may_stop_the_service_that_asks_itself) {
    asio::io_context io;
    cles::service car{io, {.name = "car1"}};
    std::string seen;
    car.on_push("stop", [&](const cles::request& r) {
        car.stop();
        seen = r.body();
    });
    answer<> a;
    car.async_push("self:stop", cles::json_text{R"({"why":"to see what happens"})"}, a.take());
    run_until(io, [&] { return a.done(); });
    BOOST_TEST(a.code == errc::stopped);
    BOOST_TEST(seen == R"({"why":"to see what happens"})");
}

// A completion handler is called from inside the service: it may destroy it.
CLES_DATA_TEST_CASE(a_completion_may_destroy_the_service_that_calls_it, carriers, kind) {
    nodes n{kind};
    n.car->on_pull("speed", [] { return 42; });
    auto asker = std::make_unique<cles::service>(n.io, knowing("asker", *n.car));
    std::vector<boost::system::error_code> codes;
    for (int i = 0; i < 5; ++i) {
        asker->async_pull("car1:speed", [&](boost::system::error_code code, const cles::json_text&) {
            codes.push_back(code);
            asker.reset();
        });
    }
    run_until(n.io, [&] { return codes.size() == 5; });
    BOOST_TEST(!codes.front());
    for (std::size_t i = 1; i < codes.size(); ++i) {
        BOOST_TEST(codes[i] == errc::stopped);
    }
}

BOOST_AUTO_TEST_CASE(a_handler_may_remove_its_own_task) {
    nodes n;
    const auto shared = std::make_shared<std::string>("not destroyed");
    n.car->on_pull("speed", [&car = *n.car, shared] {
        const bool first = car.remove(cles::verb::pull, "speed");
        const bool second = car.remove(cles::verb::pull, "speed");
        return std::to_string(int{first}) + std::to_string(int{second}) + *shared;
    });
    n.car->on_push("speed", [] {});
    auto peer = n.peer();
    BOOST_TEST(peer.ask("PULL self:speed") == R"({"value":"10not destroyed"})");
    BOOST_TEST(peer.ask("PULL self:speed").starts_with(R"({"error":"no_task")"));
    BOOST_TEST(peer.ask("PUSH self:speed") == "{}");
    BOOST_TEST(shared.use_count() == 1);
    n.car->on_pull("speed", [] { return 7; });
    BOOST_TEST(peer.ask("PULL self:speed") == R"({"value":7})");
}

BOOST_AUTO_TEST_SUITE_END()
