// SPDX-License-Identifier: BSL-1.0
// The ways to wait for a result: coroutines, callbacks, futures, and the blocking form.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/localization.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/side_thread.hpp"

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/deferred.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/use_future.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <exception>
#include <future>
#include <string>
#include <thread>

BOOST_AUTO_TEST_SUITE(tokens)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;

struct nodes {
    nodes() {
        car.on_pull("localization", [] { return localization{1, 2, 3}; });
        car.on_push("name", [](const std::string& name) { return "is " + name; });
        car.on_delegate("drive", [](const cles::request&, cles::responder r) {
            r.progress(0.5);
            r.done(7);
        });
        car.on_delegate("never", [this](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
    }

    asio::io_context io;
    std::vector<cles::responder> kept;
    cles::service car{io, listening("car1")};
    cles::service tower{io, knowing("tower", car)};
};

// Runs the coroutine to its end, and rethrows its exception.
void run_to_end(asio::io_context& io, asio::awaitable<void> work) {
    bool ended = false;
    std::exception_ptr thrown;
    asio::co_spawn(io, std::move(work), [&](std::exception_ptr e) {
        ended = true;
        thrown = e;
    });
    run_until(io, [&] { return ended; });
    if (thrown) {
        std::rethrow_exception(thrown);
    }
}

asio::awaitable<void> ask_everything(cles::service& tower) {
    const auto where = co_await tower.async_pull<localization>("car1:localization");
    BOOST_TEST((where == localization{1, 2, 3}));
    const auto named = co_await tower.async_push<std::string>("car1:name", "Ada");
    BOOST_TEST(named == "is Ada");
    double reported = 0;
    auto options = cles::call_options{}.on_progress([&](double fraction, std::string_view) { reported = fraction; });
    const auto driven = co_await tower.async_delegate<int>("car1:drive", cles::json_text{}, options);
    BOOST_TEST(driven == 7);
    BOOST_TEST(reported == 0.5);
    const auto raw = co_await tower.async_request("PULL car1:localization");
    BOOST_TEST(raw.text == R"({"utc":1,"lat":2,"lon":3})");
}

asio::awaitable<void> meet_failures(cles::service& tower) {
    std::string what;
    boost::system::error_code code;
    try {
        co_await tower.async_pull("car1:altitude");
    } catch (const cles::error& e) {
        what = e.what();
        code = e.code();
    }
    BOOST_TEST(code == errc::no_task);
    BOOST_TEST(what == "no_task: car1 has no PULL 'altitude'");
    const auto [failed, text] = co_await tower.async_pull("car1:altitude", asio::as_tuple(asio::use_awaitable));
    BOOST_TEST(failed == errc::no_task);
}

asio::awaitable<void> bind_and_fetch(cles::service& tower, cles::service& car) {
    car.update("localization", localization{4, 5, 6});
    auto feed = co_await tower.async_bind<localization>("car1:localization");
    const auto current = co_await feed.async_next();
    BOOST_TEST((current.kind == cles::feed_event::current));
    BOOST_TEST((current.value == localization{4, 5, 6}));
    co_await car.async_update("localization", localization{7, 8, 9});
    const auto update = co_await feed.async_next();
    BOOST_TEST((update.kind == cles::feed_event::update));
    BOOST_TEST((update.value == localization{7, 8, 9}));
    BOOST_TEST(update.seq == 2U);
    BOOST_TEST(update.publisher == "car1");
}

asio::awaitable<void> wait_for_ever(cles::service& tower, std::string& what) {
    try {
        co_await tower.async_delegate("car1:never", cles::json_text{});
    } catch (const cles::error& e) {
        what = e.what();
    }
}

BOOST_AUTO_TEST_CASE(a_coroutine_awaits_every_verb) {
    nodes n;
    run_to_end(n.io, ask_everything(n.tower));
}

BOOST_AUTO_TEST_CASE(a_coroutine_receives_failures_as_an_exception_with_the_peers_message) {
    nodes n;
    run_to_end(n.io, meet_failures(n.tower));
}

BOOST_AUTO_TEST_CASE(a_coroutine_fetches_from_a_feed) {
    nodes n;
    run_to_end(n.io, bind_and_fetch(n.tower, n.car));
}

BOOST_AUTO_TEST_CASE(cancelling_a_coroutine_withdraws_what_it_awaits) {
    nodes n;
    std::string what;
    bool ended = false;
    asio::cancellation_signal signal;
    asio::co_spawn(n.io, wait_for_ever(n.tower, what),
                   asio::bind_cancellation_slot(signal.slot(), [&](std::exception_ptr) { ended = true; }));
    run_until(n.io, [&] { return n.kept.size() == 1; });
    signal.emit(asio::cancellation_type::terminal);
    run_until(n.io, [&] { return ended; });
    BOOST_TEST(what.starts_with("cancelled"), what);
    run_until(n.io, [&] { return n.kept.front().stopped(); });
}

BOOST_AUTO_TEST_CASE(a_callback_gets_code_and_result) {
    nodes n;
    answer<localization> a;
    n.tower.async_pull<localization>("car1:localization", a.take());
    BOOST_TEST(!a.done());
    run_until(n.io, [&] { return a.done(); });
    BOOST_TEST((a.value == localization{1, 2, 3}));
}

BOOST_AUTO_TEST_CASE(a_callback_is_called_on_its_own_executor) {
    nodes n;
    side_thread other;
    std::promise<std::thread::id> where;
    auto told = where.get_future();
    n.tower.async_pull("car1:localization",
                       asio::bind_executor(other.io().get_executor(), [&](boost::system::error_code, cles::json_text) {
                           where.set_value(std::this_thread::get_id());
                       }));
    run_until(n.io, [&] { return told.wait_for(0s) == std::future_status::ready; });
    BOOST_TEST((told.get() == other.run([] { return std::this_thread::get_id(); })));
}

BOOST_AUTO_TEST_CASE(a_future_gives_the_result_to_another_thread) {
    side_thread home;
    std::unique_ptr<nodes> n;
    home.run([&] { n = std::make_unique<nodes>(); });
    // The services use a separate context, which this thread does not run.
    auto result = home.run([&] {
        auto future = n->tower.async_pull<localization>("car1:localization", asio::use_future);
        auto failed = n->tower.async_pull("car1:altitude", asio::use_future);
        run_until(n->io, [&] {
            return future.wait_for(0s) == std::future_status::ready && failed.wait_for(0s) == std::future_status::ready;
        });
        return std::pair{std::move(future), std::move(failed)};
    });
    BOOST_TEST((result.first.get() == localization{1, 2, 3}));
    BOOST_CHECK_EXCEPTION(result.second.get(), cles::error,
                          [](const cles::error& e) { return e.code() == errc::no_task; });
    home.run([&] { n.reset(); });
}

BOOST_AUTO_TEST_CASE(a_deferred_operation_begins_when_it_is_launched) {
    nodes n;
    answer<> a;
    auto later = n.tower.async_pull("car1:localization", asio::deferred);
    run_ready(n.io);
    std::move(later)(a.take());
    run_until(n.io, [&] { return a.done(); });
    BOOST_TEST(!a.code);
}

// -- the blocking form ---------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(the_blocking_form_gives_the_reply) {
    nodes n;
    BOOST_TEST(n.tower.request("PULL car1:localization") == R"({"utc":1,"lat":2,"lon":3})");
    BOOST_TEST(n.tower.request(R"(PUSH car1:name {"value":"Ada"})") == R"({"value":"is Ada"})");
    BOOST_TEST(n.car.request("PULL self:localization") == R"({"utc":1,"lat":2,"lon":3})");
}

BOOST_AUTO_TEST_CASE(the_blocking_form_throws_what_went_wrong) {
    nodes n;
    const auto fails_with = [&](const std::string& command, errc code, const cles::call_options& options = {}) {
        try {
            n.tower.request(command, options);
        } catch (const cles::error& e) {
            BOOST_TEST(!e.message().empty());
            return e.code() == code;
        }
        return false;
    };
    BOOST_TEST(fails_with("PULL car1:altitude", errc::no_task));
    BOOST_TEST(fails_with("PULL nobody:altitude", errc::no_target));
    BOOST_TEST(fails_with("FETCH car1:altitude", errc::bad_request));
    BOOST_TEST(fails_with("DELEGATE car1:never", errc::deadline, cles::call_options{}.deadline(50ms)));
    n.tower.stop();
    BOOST_TEST(fails_with("PULL car1:localization", errc::stopped));
}

BOOST_AUTO_TEST_CASE(the_blocking_form_inside_a_handler_would_deadlock) {
    nodes n;
    n.car.on_pull("foolish", [&] { return cles::json_text{n.car.request("PULL self:localization")}; });
    std::string seen;
    n.car.on_pull("caught", [&] {
        try {
            n.car.request("PULL self:localization");
        } catch (const cles::error& e) {
            seen = e.code() == errc::would_deadlock ? "would_deadlock" : e.what();
        }
    });
    answer<> foolish;
    answer<> caught;
    n.tower.async_pull("car1:foolish", foolish.options(), foolish.take());
    n.tower.async_pull("car1:caught", caught.take());
    run_until(n.io, [&] { return foolish.done() && caught.done(); });
    BOOST_TEST(foolish.code == errc::failed);
    BOOST_TEST(!caught.code);
    BOOST_TEST(seen == "would_deadlock");
}

// Another thread may take what the call waits for. In either case the call ends, and soon it is refused.
BOOST_AUTO_TEST_CASE(the_blocking_form_is_refused_while_another_thread_runs_the_context) {
    asio::io_context io;
    cles::service tower{io, {.name = "tower"}};
    const auto work = asio::make_work_guard(io);
    std::thread other{[&] { io.run(); }};
    bool is_refused = false;
    std::chrono::steady_clock::duration longest{};
    for (int i = 0; i < 1000 && !is_refused; ++i) {
        const auto begun = std::chrono::steady_clock::now();
        try {
            tower.request("PULL self:cles");
        } catch (const cles::error& e) {
            is_refused = e.code() == errc::would_deadlock && e.message().starts_with("another thread runs");
            BOOST_TEST(is_refused, e.what());
        }
        longest = std::max(longest, std::chrono::steady_clock::now() - begun);
    }
    BOOST_TEST((longest < 2s)); // not at the deadline of the request
    BOOST_TEST(is_refused);
    io.stop();
    other.join();
}

BOOST_AUTO_TEST_CASE(the_blocking_form_needs_a_context_that_it_can_run) {
    asio::io_context io;
    cles::service tower{asio::make_strand(io), {.name = "tower"}};
    BOOST_CHECK_EXCEPTION(tower.request("PULL self:cles"), cles::error,
                          [](const cles::error& e) { return e.code() == errc::would_deadlock; });
}

BOOST_AUTO_TEST_SUITE_END()
