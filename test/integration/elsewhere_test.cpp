// SPDX-License-Identifier: BSL-1.0
// Operations and feeds whose handlers run on another executor than the service's.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/side_thread.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/bind_executor.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_future.hpp>
#include <boost/test/unit_test.hpp>

#include <atomic>
#include <chrono>
#include <exception>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace elsewhere_test {

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;
namespace asio = boost::asio;

/// A publisher and a service on a separate thread; the test's thread runs another context.
struct fixture {
    fixture() {
        there.run([this] {
            car = std::make_unique<cles::service>(there.io(), listening("car1"));
            car->on_pull("speed", [] { return 42; });
            car->on_delegate("long", [this](const cles::request&, cles::responder r) { jobs.push_back(std::move(r)); });
            car->on_bind("place");
            tower = std::make_unique<cles::service>(there.io(), knowing("tower", *car));
        });
    }
    ~fixture() {
        there.run([this] {
            jobs.clear();
            tower.reset();
            car.reset();
        });
    }
    // Publishes continuously from the other thread.
    void publish() {
        asio::post(there.io(), [this] {
            if (publishing) {
                car->update("place", ++published);
                publish();
            }
        });
    }
    [[nodiscard]] bool is_here() { return here.get_executor().running_in_this_thread(); }

    asio::io_context here;
    asio::any_io_executor on_here = here.get_executor();
    side_thread there;
    std::vector<cles::responder> jobs;
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> tower;
    std::atomic<bool> publishing = true;
    int published = 0;
};

asio::awaitable<int> bind_and_fetch(fixture& f, int rounds) {
    int fetched = 0;
    for (int i = 0; i < rounds; ++i) {
        auto places = co_await f.tower->async_bind<int>("car1:place");
        BOOST_TEST(f.is_here());
        for (int n = 0; n < 5; ++n) {
            const auto next = co_await places.async_next();
            fetched += next.has_value() ? 1 : 0;
        }
        const int speed = co_await f.tower->async_pull<int>("car1:speed");
        BOOST_TEST(speed == 42);
    } // here the feed is destroyed
    co_return fetched;
}

} // namespace elsewhere_test

BOOST_AUTO_TEST_SUITE(elsewhere)

using namespace elsewhere_test;

BOOST_FIXTURE_TEST_CASE(a_coroutine_of_another_context_binds_fetches_and_lets_go, fixture) {
    publish();
    std::optional<int> fetched;
    std::exception_ptr thrown;
    asio::co_spawn(here, bind_and_fetch(*this, 50), [&](std::exception_ptr e, int count) {
        thrown = std::move(e);
        fetched = count;
    });
    run_until(here, [&] { return fetched.has_value(); });
    publishing = false;
    BOOST_TEST(!thrown);
    BOOST_TEST(*fetched > 200);
}

BOOST_FIXTURE_TEST_CASE(a_slot_may_be_emitted_there, fixture) {
    for (int i = 0; i < 50; ++i) {
        asio::cancellation_signal signal;
        answer<> a;
        tower->async_delegate("car1:long", cles::json_text{},
                              asio::bind_executor(on_here, asio::bind_cancellation_slot(signal.slot(), a.take())));
        for (int n = 0; n < i % 5; ++n) {
            std::this_thread::yield();
        }
        signal.emit(asio::cancellation_type::terminal);
        BOOST_TEST(a.calls == 0);
        run_until(here, [&] { return a.done(); });
        BOOST_TEST(a.code == errc::cancelled);
        BOOST_TEST(!signal.slot().has_handler());
    }
}

BOOST_FIXTURE_TEST_CASE(a_wait_for_an_event_may_be_withdrawn_there_and_begun_again, fixture) {
    std::optional<cles::feed<int>> places;
    tower->async_bind<int>("car1:place",
                           asio::bind_executor(on_here, [&](boost::system::error_code failed, cles::feed<int> made) {
                               BOOST_TEST(!failed);
                               places = std::move(made);
                           }));
    run_until(here, [&] { return places.has_value(); });
    for (int i = 0; i < 100; ++i) {
        asio::cancellation_signal signal;
        boost::system::error_code code;
        int calls = 0;
        places->async_next(asio::bind_executor(
            on_here, asio::bind_cancellation_slot(signal.slot(),
                                                  [&](boost::system::error_code failed, const cles::feed_item<int>&) {
                                                      code = failed;
                                                      ++calls;
                                                  })));
        signal.emit(asio::cancellation_type::terminal);
        run_until(here, [&] { return calls == 1; });
        BOOST_TEST(code == errc::cancelled);
    }
    int next = 0;
    places->async_next(asio::bind_executor(
        on_here, [&](boost::system::error_code, const cles::feed_item<int>& i) { next = i.value; }));
    there.run([this] { car->update("place", 7); });
    run_until(here, [&] { return next == 7; });
    places.reset();
}

// -- a pool --------------------------------------------------------------------------------------------------------

// Without explicit strands.
asio::awaitable<int> ask_often(cles::service& by, int times) {
    int answered = 0;
    auto places = co_await by.async_bind<int>("car1:place");
    for (int i = 0; i < times; ++i) {
        const int speed = co_await by.async_pull<int>("car1:speed");
        answered += speed == 42 ? 1 : 0;
        co_await by.async_update("own", i);
        if (i % 16 == 0) {
            co_await places.async_next();
        }
    }
    co_return answered;
}

BOOST_AUTO_TEST_CASE(of_a_pool_operations_are_begun_on_any_thread) {
    asio::thread_pool pool{4};
    cles::service car{pool, listening("car1")};
    car.on_pull("speed", [] { return 42; }); // from this thread, while the pool runs
    car.on_bind("place");
    car.update("place", 0);
    cles::service tower{pool, knowing("tower", car)};
    tower.set_peer("car2", car.endpoints().front());
    std::vector<std::future<int>> all;
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
    constexpr int times = 30; // up to some hundred times slower, with the publisher on a separate core
#else
    constexpr int times = 200;
#endif
    for (int i = 0; i < 8; ++i) {
        all.push_back(asio::co_spawn(pool, ask_often(tower, times), asio::use_future));
    }
    std::jthread publisher{[&](const std::stop_token& done) { // ends with the test, also if that fails
        for (int i = 1; !done.stop_requested(); ++i) {
            car.update("place", i);
        }
    }};
    for (auto& each : all) {
        BOOST_REQUIRE((each.wait_for(patience) == std::future_status::ready));
        BOOST_TEST(each.get() == times);
    }
    for (int i = 0; i < 200; ++i) { // and from the test's own thread, with handlers that have no executor
        auto pulled = tower.async_pull<int>("car1:speed", asio::use_future);
        BOOST_TEST(pulled.get() == 42);
    }
    publisher.request_stop();
    publisher.join();
    auto refused = asio::post(pool, asio::use_future([&] { // as a value: the exception is seen by one thread only
                                  try {
                                      tower.update("own", 1);
                                  } catch (const cles::error& e) {
                                      return e.code();
                                  }
                                  return boost::system::error_code{};
                              }));
    BOOST_TEST(refused.get() == errc::would_deadlock);
    for (auto* each : {&tower, &car}) {
        asio::post(each->get_executor(), asio::use_future([each] { each->stop(); })).get();
    }
    pool.join();
}

BOOST_AUTO_TEST_SUITE_END()
