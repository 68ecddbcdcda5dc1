// SPDX-License-Identifier: BSL-1.0
// The forms of handlers: coroutines with a responder, move-only objects, types of the standard library; and the
// treatment of text that is not UTF-8.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace handler_types {

struct note {
    std::string text{};
};
BOOST_DESCRIBE_STRUCT(note, (), (text))

} // namespace handler_types

BOOST_AUTO_TEST_SUITE(handler_forms)

using namespace cles::test;
using namespace std::chrono_literals;
using handler_types::note;
namespace asio = boost::asio;
using cles::errc;

const std::string bad = "a\xFFz";

struct nodes {
    asio::io_context io;
    cles::service car{io, listening("car1")};
    cles::service tower{io, knowing("tower", car)};

    template <class T, class B>
    answer<T> delegate(const std::string& noun, const B& body) {
        answer<T> got;
        tower.async_delegate<T>("car1:" + noun, body, got.options(), got.take());
        run_until(io, [&] { return got.done(); });
        return got;
    }
    // "code: message"
    template <class B>
    std::string failure(const std::string& noun, const B& body) {
        const auto got = delegate<cles::json_text>(noun, body);
        return got.code ? got.code.message() + ": " + got.words : got.value.text;
    }
};

// -- coroutines with a responder -----------------------------------------------------------------------------------

asio::awaitable<void> answer_later(cles::request asked, cles::responder answer) {
    asio::steady_timer pause{co_await asio::this_coro::executor, 1ms};
    co_await pause.async_wait(asio::use_awaitable);
    answer.done(std::string{asked.task()});
}

asio::awaitable<void> answer_and_go_on(const cles::request&, cles::responder answer, bool& ended) {
    answer.done(1);
    asio::steady_timer pause{co_await asio::this_coro::executor, 1ms};
    co_await pause.async_wait(asio::use_awaitable);
    ended = true;
}

BOOST_AUTO_TEST_CASE(a_coroutine_with_a_responder_runs_and_answers_through_it) {
    nodes n;
    n.car.on_delegate("later", answer_later);
    const auto got = n.delegate<std::string>("later", cles::json_text{});
    BOOST_TEST(!got.code);
    BOOST_TEST(got.value == "later");
}

BOOST_AUTO_TEST_CASE(it_may_go_on_behind_its_answer) {
    nodes n;
    bool ended = false;
    n.car.on_delegate("on", [&ended](cles::request r, cles::responder answer) -> asio::awaitable<void> {
        return answer_and_go_on(r, std::move(answer), ended);
    });
    BOOST_TEST(n.delegate<int>("on", cles::json_text{}).value == 1);
    run_until(n.io, [&] { return ended; });
}

BOOST_AUTO_TEST_CASE(what_it_throws_is_the_answer_and_so_is_an_end_without_one) {
    nodes n;
    n.car.on_delegate("throws", [](cles::request, cles::responder) -> asio::awaitable<void> {
        throw cles::error(errc::denied, "not you");
        co_return;
    });
    n.car.on_delegate("ends", [](cles::request, cles::responder) -> asio::awaitable<void> { co_return; });
    const auto thrown = n.delegate<int>("throws", cles::json_text{});
    BOOST_TEST(thrown.code == errc::denied);
    BOOST_TEST(thrown.words == "car1: not you");
    BOOST_TEST(n.delegate<int>("ends", cles::json_text{}).code == errc::failed);
}

asio::awaitable<void> wait_to_be_stopped(cles::responder answer, boost::system::error_code& ended) {
    asio::steady_timer pause{co_await asio::this_coro::executor, 1h};
    try {
        co_await pause.async_wait(asio::use_awaitable);
    } catch (const boost::system::system_error& e) {
        ended = e.code();
    }
    answer.fail(errc::cancelled, "stopped");
}

BOOST_AUTO_TEST_CASE(it_is_cancelled_with_its_request) {
    nodes n;
    boost::system::error_code ended;
    bool begun = false;
    n.car.on_delegate("wait", [&](cles::request, cles::responder answer) -> asio::awaitable<void> {
        begun = true;
        return wait_to_be_stopped(std::move(answer), ended);
    });
    asio::cancellation_signal signal;
    answer<> got;
    n.tower.async_delegate("car1:wait", cles::json_text{}, got.options(),
                           asio::bind_cancellation_slot(signal.slot(), got.take()));
    run_until(n.io, [&] { return begun; });
    signal.emit(asio::cancellation_type::terminal);
    run_until(n.io, [&] { return got.done() && ended; });
    BOOST_TEST((ended == asio::error::operation_aborted));
    BOOST_TEST((got.code == asio::error::operation_aborted));
}

// -- move-only objects ---------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(handlers_that_only_move_serve_every_verb) {
    nodes n;
    const auto only = [](int i) { return std::make_unique<int>(i); };
    n.car.on_pull("pull", [i = only(1)] { return *i; });
    n.car.on_push("push", [i = only(2)](int x) mutable { return *i += x; });
    n.car.on_delegate("responder", [i = only(3)](const cles::request&, cles::responder r) { r.done(*i); });
    n.car.on_delegate("coroutine", [i = only(4)](cles::request) -> asio::awaitable<int> { co_return *i; });
    n.car.on_update("update", [i = only(5)](const cles::request&) {});
    n.car.on_bind("bind", [i = only(6)](const cles::request&) {});
    const auto ask = [&](const std::string& command) {
        answer<> got;
        n.tower.async_request(command, got.options(), got.take());
        run_until(n.io, [&] { return got.done(); });
        return got.code ? got.words : got.value.text;
    };
    BOOST_TEST(ask("PULL car1:pull") == R"({"value":1})");
    BOOST_TEST(ask(R"(PUSH car1:push {"value":5})") == R"({"value":7})");
    BOOST_TEST(ask(R"(PUSH car1:push {"value":5})") == R"({"value":12})");
    BOOST_TEST(ask("DELEGATE car1:responder") == R"({"value":3})");
    BOOST_TEST(ask("DELEGATE car1:coroutine") == R"({"value":4})");
    BOOST_TEST(ask(R"(UPDATE car1:update {"a":1})") == "{}");
}

// -- parameters ----------------------------------------------------------------------------------------------------

using texts = std::vector<std::string>;

std::string joined(const texts& all) {
    std::string out;
    for (const auto& each : all) {
        out += each + ";";
    }
    return out;
}

std::string free_function(texts all) { return joined(all); }

BOOST_AUTO_TEST_CASE(texts_are_the_parameters_of_pull_and_bind_and_the_body_of_other_verbs) {
    nodes n;
    n.car.on_pull("function", free_function);
    n.car.on_pull("request",
                  [](const cles::request& r, const texts& all) { return std::string{r.node()} + joined(all); });
    n.car.on_pull("coroutine", [](texts all) -> asio::awaitable<std::string> {
        asio::steady_timer pause{co_await asio::this_coro::executor, 1ms};
        co_await pause.async_wait(asio::use_awaitable);
        co_return joined(all);
    });
    n.car.on_pull("moves", [only = std::make_unique<int>(7)](texts all) { return all.size() + *only; });
    std::string bound;
    n.car.on_bind("function", [&](texts all) { bound = joined(all); });
    n.car.on_push("function", free_function);
    n.car.on_delegate("function", free_function);
    const auto ask = [&](const std::string& command) {
        answer<> got;
        n.tower.async_request(command, got.options(), got.take());
        run_until(n.io, [&] { return got.done(); });
        return got.code ? got.words : got.value.text;
    };
    BOOST_TEST(ask("PULL car1:function") == R"({"value":""})");
    BOOST_TEST(ask("PULL car1:function/UTC/a%20b") == R"({"value":"UTC;a b;"})");
    BOOST_TEST(ask("PULL car1:request/UTC") == R"({"value":"car1UTC;"})");
    BOOST_TEST(ask("PULL car1:coroutine/UTC") == R"({"value":"UTC;"})");
    BOOST_TEST(ask("PULL car1:moves/a/b") == R"({"value":9})");
    BOOST_TEST(ask(R"(PUSH car1:function/UTC ["x"])") == R"({"value":"x;"})");
    BOOST_TEST(ask(R"(DELEGATE car1:function ["x","y"])") == R"({"value":"x;y;"})");
    answer<cles::feed<cles::json_text>> feed;
    n.tower.async_bind("car1:function/fast", feed.take());
    run_until(n.io, [&] { return feed.done(); });
    BOOST_TEST(!feed.code);
    BOOST_TEST(bound == "fast;");
}

// -- types ---------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(types_of_the_standard_library_are_sent_and_received) {
    nodes n;
    using either = std::variant<double, note>;
    n.car.on_delegate("double", [](std::chrono::milliseconds x) { return x * 2; });
    n.car.on_delegate("maybe", [](std::optional<int> x) { return x; });
    n.car.on_delegate("either", [](either x) { return x; });
    n.car.on_delegate("swap", [](std::pair<int, std::string> x) { return std::pair{x.second, x.first}; });
    n.car.on_delegate("later", [](std::chrono::system_clock::time_point x) { return x + 1s; });
    BOOST_TEST((n.delegate<std::chrono::milliseconds>("double", 750ms).value == 1500ms));
    BOOST_TEST((n.delegate<std::optional<int>>("maybe", std::optional<int>{5}).value == 5));
    BOOST_TEST((!n.delegate<std::optional<int>>("maybe", std::optional<int>{}).value.has_value()));
    BOOST_TEST((!n.delegate<std::optional<int>>("maybe", cles::json_text{}).value.has_value()));
    BOOST_TEST((std::get<double>(n.delegate<either>("either", either{2.5}).value) == 2.5));
    BOOST_TEST((std::get<note>(n.delegate<either>("either", either{note{"x"}}).value).text == "x"));
    const std::pair<std::string, int> swapped{"a", 1};
    BOOST_TEST((n.delegate<std::pair<std::string, int>>("swap", std::pair{1, std::string{"a"}}).value == swapped));
    const auto now = std::chrono::system_clock::now();
    BOOST_TEST((n.delegate<std::chrono::system_clock::time_point>("later", now).value == now + 1s));
}

// -- text that is not UTF-8 ----------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_result_that_is_not_utf8_is_failed_at_the_sender) {
    nodes n;
    n.car.on_delegate("plain", [] { return bad; });
    n.car.on_delegate("struct", [] { return std::vector<note>{{"a"}, {bad}}; });
    n.car.on_delegate("coroutine", [](cles::request) -> asio::awaitable<std::string> { co_return bad; });
    n.car.on_delegate("responder", [](const cles::request&, cles::responder r) { r.done(bad); });
    n.car.on_delegate("later", [&](const cles::request&, cles::responder r) {
        asio::post(n.io, [r = std::move(r)] { r.done(note{bad}); }); // where an exception would not be caught
    });
    const std::string failed = make_error_code(errc::failed).message();
    BOOST_TEST(n.failure("plain", cles::json_text{}) == failed + ": car1: text that is not UTF-8");
    BOOST_TEST(n.failure("struct", cles::json_text{}) == failed + ": car1: [1].text: text that is not UTF-8");
    BOOST_TEST(n.failure("coroutine", cles::json_text{}) == failed + ": car1: text that is not UTF-8");
    BOOST_TEST(n.failure("responder", cles::json_text{}) == failed + ": car1: text that is not UTF-8");
    BOOST_TEST(n.failure("later", cles::json_text{}) == failed + ": car1: text: text that is not UTF-8");
}

BOOST_AUTO_TEST_CASE(a_body_that_is_not_utf8_is_a_failed_conversion_at_the_caller_and_never_inside_the_call) {
    nodes n;
    int served = 0;
    n.car.on_push("note", [&](const cles::request&) { ++served; });
    const auto pushed = [&](const auto& body) {
        answer<> got;
        n.tower.async_push("car1:note", body, got.options(), got.take());
        BOOST_TEST(!got.done());
        run_until(n.io, [&] { return got.done(); });
        BOOST_TEST(got.code == errc::conversion);
        return got.words;
    };
    BOOST_TEST(pushed(bad) == "text that is not UTF-8");
    BOOST_TEST(pushed(note{bad}) == "text: text that is not UTF-8");
    BOOST_TEST(pushed(cles::json_text{"{"}).starts_with("the text to send is not JSON"));
    BOOST_TEST(served == 0);
}

BOOST_AUTO_TEST_CASE(an_update_that_is_not_utf8_is_not_published) {
    nodes n;
    const auto fails = [](const cles::error& e) { return e.code() == errc::conversion; };
    BOOST_CHECK_EXCEPTION(n.car.update("note", note{bad}), cles::error, fails);
    BOOST_CHECK_EXCEPTION(n.car.make_publisher().update("note", note{bad}), cles::error, fails);
    answer<void> waited;
    n.car.async_update("note", note{bad}, waited.take());
    BOOST_TEST(!waited.done());
    run_until(n.io, [&] { return waited.done(); });
    BOOST_TEST(waited.code == errc::conversion);
    n.car.update("note", note{"fine"}); // the first
    answer<cles::feed<note>> bound;
    n.tower.async_bind<note>("car1:note", bound.take());
    run_until(n.io, [&] { return bound.done(); });
    answer<cles::feed_item<note>> current;
    bound.value.async_next(current.take());
    run_until(n.io, [&] { return current.done(); });
    BOOST_TEST(current.value.value.text == "fine");
}

BOOST_AUTO_TEST_SUITE_END()
