// SPDX-License-Identifier: BSL-1.0
// Every token that reports errors by exceptions throws a `cles::error` with the peer's message.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/localization.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/side_thread.hpp"

#include <boost/asio/append.hpp>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/bind_allocator.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/bind_executor.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/consign.hpp>
#include <boost/asio/deferred.hpp>
#include <boost/asio/experimental/parallel_group.hpp>
#include <boost/asio/prepend.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/use_future.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <exception>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <utility>

BOOST_AUTO_TEST_SUITE(exceptions)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;

const std::string words = "car1 has no PULL 'altitude'";

struct nodes {
    nodes() {
        car.on_pull("localization", [] { return localization{1, 2, 3}; });
    }

    asio::io_context io;
    cles::service car{io, listening("car1")};
    cles::service tower{io, knowing("tower", car)};
};

// What the coroutine throws: "code: the peer's message", or another description.
std::string thrown_by(asio::io_context& io, asio::awaitable<void> work) {
    bool ended = false;
    std::string text = "nothing";
    asio::co_spawn(io, std::move(work), [&](std::exception_ptr thrown) {
        ended = true;
        if (thrown) {
            try {
                std::rethrow_exception(thrown);
            } catch (const cles::error& e) {
                text = e.code() == errc::no_task ? e.message() : e.what();
            } catch (const std::exception& e) {
                text = std::string{"no cles::error: "} + e.what();
            }
        }
    });
    run_until(io, [&] { return ended; });
    return text;
}

// Awaits a request that fails, with this token.
template <class Token>
asio::awaitable<void> await_with(cles::service& tower, Token token) {
    co_await tower.async_pull<int>("car1:altitude", std::move(token));
}
template <class Token>
asio::awaitable<void> await_update_with(cles::service& car, Token token) {
    co_await car.async_update("no such noun", 1, std::move(token));
}
template <class Token>
asio::awaitable<void> await_bind_with(cles::service& tower, Token token) {
    co_await tower.async_bind<int>("car1:altitude", std::move(token));
}

asio::awaitable<void> await_deferred_later(cles::service& tower) {
    auto operation = tower.async_pull<int>("car1:altitude", asio::deferred);
    co_await std::move(operation)(asio::use_awaitable);
}

asio::awaitable<void> await_deferred_kept(cles::service& tower) {
    const auto operation = tower.async_pull<int>("car1:altitude", asio::deferred);
    co_await operation;
}

BOOST_AUTO_TEST_CASE(tokens_that_throw_contain_the_peers_message) {
    nodes n;
    const auto thrown = [&](auto token) { return thrown_by(n.io, await_with(n.tower, std::move(token))); };
    const auto executor = n.io.get_executor();
    asio::cancellation_signal signal;
    auto timer = asio::use_awaitable.as_default_on(asio::steady_timer(n.io));

    BOOST_TEST(thrown(asio::use_awaitable) == words);
    BOOST_TEST(thrown(asio::bind_executor(executor, asio::use_awaitable)) == words);
    BOOST_TEST(thrown(asio::bind_executor(timer.get_executor(), asio::use_awaitable)) == words);
    BOOST_TEST(thrown(asio::bind_allocator(std::allocator<char>{}, asio::use_awaitable)) == words);
    BOOST_TEST(thrown(asio::bind_cancellation_slot(signal.slot(), asio::use_awaitable)) == words);
    BOOST_TEST(thrown(asio::bind_cancellation_slot(
                   signal.slot(), asio::bind_executor(executor, asio::bind_allocator(std::allocator<char>{},
                                                                                     asio::use_awaitable)))) == words);
    BOOST_TEST(thrown(asio::append(asio::use_awaitable, 1, 2)) == words);
    BOOST_TEST(thrown(asio::consign(asio::use_awaitable, std::make_shared<int>(1))) == words);
}

BOOST_AUTO_TEST_CASE(an_operation_that_was_deferred_throws_what_it_would_have_thrown_at_once) {
    nodes n;
    const auto thrown = [&](auto token) { return thrown_by(n.io, await_with(n.tower, std::move(token))); };
    asio::cancellation_signal signal;
    BOOST_TEST(thrown(asio::deferred) == words);
    BOOST_TEST(thrown(asio::bind_executor(n.io.get_executor(), asio::deferred)) == words);
    BOOST_TEST(thrown(asio::bind_cancellation_slot(signal.slot(), asio::deferred)) == words);
    BOOST_TEST(thrown_by(n.io, await_deferred_later(n.tower)) == words);
    BOOST_TEST(thrown_by(n.io, await_deferred_kept(n.tower)) == words);
}

BOOST_AUTO_TEST_CASE(other_operations_do_as_requests_do) {
    nodes n;
    const auto executor = n.io.get_executor();
    const auto updated = thrown_by(n.io, await_update_with(n.car, asio::use_awaitable));
    BOOST_TEST(updated.starts_with("invalid_name: "), updated);
    BOOST_TEST(thrown_by(n.io, await_update_with(n.car, asio::bind_executor(executor, asio::use_awaitable))) ==
               updated);
    BOOST_TEST(thrown_by(n.io, await_update_with(n.car, asio::deferred)) == updated);
    const auto bound = thrown_by(n.io, await_bind_with(n.tower, asio::use_awaitable));
    BOOST_TEST(bound != "nothing");
    BOOST_TEST(!bound.starts_with("no cles::error"), bound);
    BOOST_TEST(thrown_by(n.io, await_bind_with(n.tower, asio::bind_executor(executor, asio::use_awaitable))) == bound);
    BOOST_TEST(thrown_by(n.io, await_bind_with(n.tower, asio::deferred)) == bound);
}

asio::awaitable<void> take_codes(cles::service& tower) {
    const auto [first, none] = co_await tower.async_pull<int>("car1:altitude", asio::as_tuple(asio::use_awaitable));
    BOOST_TEST((first == errc::no_task));
    auto wrapped = asio::bind_executor(tower.get_executor(), asio::as_tuple(asio::use_awaitable));
    const auto [second, also_none] = co_await tower.async_pull<int>("car1:altitude", std::move(wrapped));
    BOOST_TEST((second == errc::no_task));
    boost::system::error_code third;
    co_await tower.async_pull<int>("car1:altitude", asio::redirect_error(asio::use_awaitable, third));
    BOOST_TEST((third == errc::no_task));
    boost::system::error_code fourth;
    auto redirected = asio::redirect_error(asio::bind_executor(tower.get_executor(), asio::use_awaitable), fourth);
    co_await tower.async_pull<int>("car1:altitude", std::move(redirected));
    BOOST_TEST((fourth == errc::no_task));
    const auto [fifth, nothing] = co_await tower.async_pull<int>("car1:altitude", asio::as_tuple(asio::deferred));
    BOOST_TEST((fifth == errc::no_task));
    const auto [before, sixth, zero] =
        co_await tower.async_pull<int>("car1:altitude", asio::prepend(asio::use_awaitable, 7));
    BOOST_TEST(before == 7);
    BOOST_TEST((sixth == errc::no_task));
}

BOOST_AUTO_TEST_CASE(tokens_that_do_not_throw_give_the_code) {
    nodes n;
    BOOST_TEST(thrown_by(n.io, take_codes(n.tower)) == "nothing");
}

asio::awaitable<void> take_values(cles::service& tower) {
    const auto executor = tower.get_executor();
    const auto first = co_await tower.async_pull<localization>("car1:localization", asio::deferred);
    BOOST_TEST((first == localization{1, 2, 3}));
    auto bound = asio::bind_executor(executor, asio::use_awaitable);
    const auto second = co_await tower.async_pull<localization>("car1:localization", std::move(bound));
    BOOST_TEST((second == localization{1, 2, 3}));
    auto appended = asio::append(asio::use_awaitable, 5);
    const auto [third, five] = co_await tower.async_pull<localization>("car1:localization", std::move(appended));
    BOOST_TEST((third == localization{1, 2, 3}));
    BOOST_TEST(five == 5);
}

BOOST_AUTO_TEST_CASE(what_succeeds_gives_its_value_all_the_same) {
    nodes n;
    BOOST_TEST(thrown_by(n.io, take_values(n.tower)) == "nothing");
}

BOOST_AUTO_TEST_CASE(futures_throw_the_peers_message) {
    side_thread home;
    std::unique_ptr<nodes> n;
    home.run([&] { n = std::make_unique<nodes>(); });
    auto results = home.run([&] {
        auto plain = n->tower.async_pull<int>("car1:altitude", asio::use_future);
        auto bound =
            n->tower.async_pull<int>("car1:altitude", asio::bind_executor(n->io.get_executor(), asio::use_future));
        auto allocated =
            n->tower.async_pull<int>("car1:altitude", asio::bind_allocator(std::allocator<char>{}, asio::use_future));
        auto later = n->tower.async_pull<int>("car1:altitude", asio::deferred)(asio::use_future);
        std::future<int> futures[] = {std::move(plain), std::move(bound), std::move(allocated), std::move(later)};
        for (auto& f : futures) {
            run_until(n->io, [&] { return f.wait_for(0s) == std::future_status::ready; });
        }
        return std::tuple{std::move(futures[0]), std::move(futures[1]), std::move(futures[2]), std::move(futures[3])};
    });
    const auto check = [](std::future<int>& f) {
        BOOST_CHECK_EXCEPTION(f.get(), cles::error,
                              [](const cles::error& e) { return e.code() == errc::no_task && e.message() == words; });
    };
    std::apply([&](auto&... f) { (check(f), ...); }, results);
    home.run([&] { n.reset(); });
}

BOOST_AUTO_TEST_CASE(a_deferred_operation_serves_callbacks_and_groups_with_the_code) {
    nodes n;
    int calls = 0;
    n.tower.async_pull<int>("car1:altitude", asio::deferred)([&](boost::system::error_code code, int) {
        BOOST_TEST((code == errc::no_task));
        ++calls;
    });
    asio::steady_timer timer{n.io, 1h};
    asio::experimental::make_parallel_group(n.tower.async_pull<int>("car1:altitude", asio::deferred),
                                            timer.async_wait(asio::deferred))
        .async_wait(asio::experimental::wait_for_one(),
                    [&](auto order, boost::system::error_code code, int, boost::system::error_code waited) {
                        BOOST_TEST(order[0] == 0U);
                        BOOST_TEST((code == errc::no_task));
                        BOOST_TEST((waited == asio::error::operation_aborted));
                        ++calls;
                    });
    run_until(n.io, [&] { return calls == 2; });
}

BOOST_AUTO_TEST_CASE(a_completion_handler_that_can_only_be_moved_is_called) {
    nodes n;
    int calls = 0;
    const auto handler = [&] {
        return [&calls, only = std::make_unique<int>(1)](boost::system::error_code code, const auto&...) {
            BOOST_TEST(!code);
            calls += *only;
        };
    };
    n.tower.async_pull("car1:localization", handler());
    n.tower.async_request("PULL car1:localization", handler());
    n.car.async_update("noun", 1, handler());
    n.tower.async_pull<localization>("car1:localization", asio::deferred)(handler());
    n.tower.async_pull("car1:localization", asio::bind_executor(asio::make_strand(n.io), handler()));
    cles::feed<int> kept;
    n.tower.async_bind<int>("car1:noun",
                            [&, only = std::make_unique<int>(1)](boost::system::error_code, cles::feed<int> f) {
                                kept = std::move(f);
                                calls += *only;
                            });
    run_until(n.io, [&] { return calls == 6; });
    kept.async_next(handler());
    run_until(n.io, [&] { return calls == 7; });
}

BOOST_AUTO_TEST_SUITE_END()
