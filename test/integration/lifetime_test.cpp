// SPDX-License-Identifier: BSL-1.0
// The lifetime of a service and its executor: foreign event loops, thread pools, and destruction during operations.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"
#include "support/side_thread.hpp"

#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_future.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(lifetime)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;

constexpr std::array carriers{carrier::tcp4, carrier::unix_file, carrier::inproc};

// Runs it on the service's executor and waits for it.
template <class F>
void run_on(const asio::any_io_executor& executor, F f) {
    asio::post(executor, asio::use_future([&f] { f(); })).get();
}

CLES_DATA_TEST_CASE(a_foreign_loop_polls, carriers, kind) {
    asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    car.on_pull("speed", [] { return 42; });
    car.on_bind("place");
    cles::service tower{io, knowing("tower", car)};
    answer<int> a;
    feed_log feed;
    tower.async_pull<int>("car1:speed", a.take());
    feed.bind(tower, "car1:place");
    const auto turn_until = [&](auto holds) {
        const auto end = std::chrono::steady_clock::now() + patience;
        while (!holds()) {
            BOOST_REQUIRE((std::chrono::steady_clock::now() < end));
            io.restart();
            io.poll(); // here the host program would do its own work
        }
    };
    turn_until([&] { return a.done() && feed.bound; });
    car.update("place", 1);
    turn_until([&] { return feed.items.size() == 1; });
    BOOST_TEST(a.value == 42);
}

BOOST_AUTO_TEST_CASE(a_service_that_is_closed_completes_running_requests_and_announces_that_it_leaves) {
    asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4)};
    std::optional<cles::responder> job;
    car.on_delegate("work", [&](const cles::request&, cles::responder r) { job.emplace(std::move(r)); });
    const auto url = car.endpoints().front();
    scripted_peer peer{io, url};
    scripted_peer idle{io, url};
    peer.send("DELEGATE self:work id=1\n");
    run_until(io, [&] { return job.has_value(); });
    answer<void> closed;
    car.async_close(patience, closed.take());
    BOOST_TEST(peer.ask("PULL self:cles id=2").starts_with(R"(id=2 {"error":"busy")"));
    BOOST_TEST(!closed.done());
    job->done(7);
    BOOST_TEST(peer.line() == "id=1 {\"value\":7}");
    BOOST_TEST(peer.rest() == "PUSH self:cles/leaving reply=no\n");
    BOOST_TEST(idle.rest() == "PUSH self:cles/leaving reply=no\n");
    peer.close();
    idle.close();
    run_until(io, [&] { return closed.done(); });
    BOOST_TEST(!closed.code);
    car.stop();
}

BOOST_AUTO_TEST_CASE(what_is_published_last_arrives_before_a_service_that_is_closed_leaves) {
    asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4)};
    car.on_bind("state");
    const auto url = car.endpoints().front();
    scripted_peer all{io, url};
    scripted_peer newest{io, url};
    BOOST_TEST(all.ask("BIND self:state id=1") == "id=1 {}");
    BOOST_TEST(newest.ask("BIND self:state id=1 every=60000") == "id=1 {}");
    car.update("state", "starting");
    BOOST_TEST(newest.line().ends_with(R"({"value":"starting"})")); // the next one may wait for a minute
    car.update("state", "moving");
    auto elsewhere = car.make_publisher();
    std::thread{[&] { elsewhere.update("state", "offline"); }}.join();
    answer<void> closed;
    car.async_close(patience, closed.take());
    for (const auto* each : {"starting", "moving", "offline"}) {
        BOOST_TEST(all.line().ends_with(R"({"value":")" + std::string{each} + R"("})"));
    }
    BOOST_TEST(all.rest() == "PUSH self:cles/leaving reply=no\n");
    BOOST_TEST(newest.line().ends_with(R"({"value":"offline"})"));
    BOOST_TEST(newest.rest() == "PUSH self:cles/leaving reply=no\n");
    all.close();
    newest.close();
    run_until(io, [&] { return closed.done(); });
    BOOST_TEST(!closed.code);
}

BOOST_AUTO_TEST_CASE(a_service_that_is_closed_waits_for_a_subscriber_that_reads_slowly) {
    asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4)};
    car.on_bind("picture");
    scripted_peer peer{io, car.endpoints().front(), buffers::small};
    BOOST_TEST(peer.ask("BIND self:picture id=1 keep=1000") == "id=1 {}");
    const std::string large(100'000, 'x'); // more than sockets and the link keep
    constexpr int many = 30;
    for (int i = 0; i < many; ++i) {
        car.update("picture", large);
    }
    answer<void> closed;
    car.async_close(patience, closed.take());
    run_ready(io);
    BOOST_TEST(!closed.done());
    for (int i = 0; i < many; ++i) {
        BOOST_TEST(peer.line().size() > large.size());
    }
    BOOST_TEST(peer.rest() == "PUSH self:cles/leaving reply=no\n");
    peer.close();
    run_until(io, [&] { return closed.done(); });
}

BOOST_AUTO_TEST_CASE(what_another_thread_has_published_is_sent_when_the_service_is_stopped) {
    asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4)};
    car.on_bind("state");
    scripted_peer peer{io, car.endpoints().front()};
    BOOST_TEST(peer.ask("BIND self:state id=1") == "id=1 {}");
    auto elsewhere = car.make_publisher();
    std::thread{[&] { elsewhere.update("state", "offline"); }}.join();
    car.stop();
    BOOST_TEST(peer.line().ends_with(R"({"value":"offline"})"));
}

BOOST_AUTO_TEST_CASE(a_service_that_is_closed_waits_for_its_handlers_no_longer_than_it_may) {
    asio::io_context io;
    asio::io_context other;
    cles::service car{io, listening("car1", carrier::tcp4)};
    int begun = 0;
    bool stopped = false;
    std::optional<cles::responder> job;
    car.on_delegate("work", [&](const cles::request&, cles::responder r) {
        ++begun;
        r.on_stop([&] { stopped = true; });
        job.emplace(std::move(r));
    });
    cles::service tower{other, knowing("tower", car)};
    answer<> first;
    answer<> second;
    const auto until = [&](auto holds) {
        run_until(io, [&] {
            other.restart();
            other.poll();
            return holds();
        });
    };
    tower.async_delegate("car1:work", 1, first.take());
    until([&] { return job.has_value(); });
    answer<void> closed;
    answer<void> twice;
    car.async_close(30ms, closed.take());
    car.async_close(30ms, twice.take());
    tower.async_delegate("car1:work", 2, second.take());
    until([&] { return closed.done() && twice.done() && first.done() && second.done(); });
    BOOST_TEST(!closed.code);
    BOOST_TEST((twice.code == errc::stopped));
    BOOST_TEST((first.code == errc::unavailable)); // it had started
    BOOST_TEST(stopped);
    BOOST_TEST((second.code == errc::busy)); // it had not
    BOOST_TEST(begun == 1);
    answer<> third;
    tower.async_delegate("car1:work", 3, third.take());
    until([&] { return third.done(); });
    BOOST_TEST((third.code == boost::system::errc::connection_refused));
}

BOOST_AUTO_TEST_CASE(a_service_that_is_stopped_while_it_closes_reports_that) {
    asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4)};
    std::optional<cles::responder> job;
    car.on_delegate("work", [&](const cles::request&, cles::responder r) { job.emplace(std::move(r)); });
    scripted_peer peer{io, car.endpoints().front()};
    peer.send("DELEGATE self:work id=1\n");
    run_until(io, [&] { return job.has_value(); });
    answer<void> closed;
    car.async_close(patience, closed.take());
    car.stop();
    run_until(io, [&] { return closed.done(); });
    BOOST_TEST((closed.code == errc::stopped));
}

BOOST_AUTO_TEST_CASE(a_service_that_only_asks_leaves_its_context_without_work) {
    asio::io_context io;
    const cles::service tower{io, {.name = "tower"}};
    io.run(); // runs to completion
    BOOST_TEST(io.stopped());
}

CLES_DATA_TEST_CASE(a_stopped_service_leaves_its_context_without_work, carriers, kind) {
    asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    car.on_pull("speed", [] { return 42; });
    cles::service tower{io, knowing("tower", car)};
    answer<int> a;
    tower.async_pull<int>("car1:speed", a.take());
    run_until(io, [&] { return a.done(); });
    car.stop();
    car.stop();
    tower.stop();
    io.restart();
    io.run_for(patience);
    BOOST_TEST(io.stopped());
    BOOST_CHECK_NO_THROW(car.update("place", 1)); // without subscribers
}

CLES_DATA_TEST_CASE(a_service_on_a_pool_takes_a_strand, carriers, kind) {
    asio::thread_pool pool{4};
    cles::service car{pool, listening("car1", kind)};
    cles::service tower{pool, knowing("tower", car)};
    constexpr int count = 500;
    int inside = 0; // deliberately unguarded: the strand serialises access
    int served = 0;
    int answered = 0;
    int failed = 0;
    int most = 0;
    std::promise<void> all;
    run_on(car.get_executor(), [&] {
        car.on_pull("speed", [&] {
            most = std::max(most, ++inside);
            ++served;
            --inside;
            return served;
        });
        car.on_bind("place");
    });
    run_on(tower.get_executor(), [&] {
        for (int i = 0; i < count; ++i) {
            tower.async_pull<int>("car1:speed", [&](boost::system::error_code code, int) {
                failed += code ? 1 : 0;
                if (++answered == count) {
                    all.set_value();
                }
            });
        }
    });
    BOOST_REQUIRE((all.get_future().wait_for(patience) == std::future_status::ready));
    run_on(car.get_executor(), [] {}); // everything before is visible from here on
    BOOST_TEST(failed == 0);
    BOOST_TEST(most == 1);
    auto later = asio::post(tower.get_executor(),
                            asio::use_future([&] { return tower.async_pull<int>("car1:speed", asio::use_future); }))
                     .get();
    BOOST_TEST(later.get() == count + 1);

    std::atomic<int> seen = 0;
    auto feed = std::make_unique<feed_log>();
    run_on(tower.get_executor(), [&] { feed->bind(tower, "car1:place"); });
    for (int i = 0; i < 10'000 && seen == 0; ++i) {
        run_on(car.get_executor(), [&, i] { car.update("place", i); });
        run_on(tower.get_executor(), [&] { seen = static_cast<int>(feed->items.size()); });
    }
    BOOST_TEST(seen > 0);
    run_on(tower.get_executor(), [&] {
        feed.reset();
        tower.stop();
    });
    run_on(car.get_executor(), [&] { car.stop(); });
    pool.join();
}

CLES_DATA_TEST_CASE(services_of_two_threads_talk, carriers, kind) {
    side_thread there;
    side_thread here;
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> tower;
    there.run([&] {
        car = std::make_unique<cles::service>(there.io(), listening("car1", kind));
        car->on_push("echo", [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; });
    });
    std::vector<std::future<cles::json_text>> replies;
    here.run([&] {
        tower = std::make_unique<cles::service>(here.io(), knowing("tower", *car));
        for (int i = 0; i < 300; ++i) {
            replies.push_back(
                tower->async_push("car1:echo", cles::json_text{"[" + std::to_string(i) + "]"}, asio::use_future));
        }
    });
    for (std::size_t i = 0; i < replies.size(); ++i) {
        BOOST_REQUIRE((replies[i].wait_for(patience) == std::future_status::ready));
        BOOST_REQUIRE(replies[i].get().text == "[" + std::to_string(i) + "]");
    }
    there.run([&] { car.reset(); }); // during the lifetime of the link
    auto refused = here.run([&] { return tower->async_push("car1:echo", cles::json_text{}, asio::use_future); });
    BOOST_CHECK_THROW(refused.get(), cles::error);
    here.run([&] { tower.reset(); });
}

// A service on a separate thread, with feeds from another one.
struct remote_node {
    remote_node(const std::string& name, carrier kind) {
        thread.run([&] {
            node = std::make_unique<cles::service>(thread.io(), listening(name, kind));
            node->on_bind("place");
            node->update("place", 1);
        });
    }
    ~remote_node() {
        thread.run([this] {
            feeds.clear();
            node.reset();
        });
    }
    // Binds without waiting for anything.
    void bind_many(const remote_node& other) {
        boost::asio::post(thread.io(), [this, &other] {
            for (int i = 0; i < 20; ++i) {
                feeds.push_back(std::make_unique<feed_log>());
                feeds.back()->bind(*node, "self:place", cles::bind_options{}.at(other.node->endpoints().front()));
            }
        });
    }
    void wait_for_feeds() {
        const auto end = std::chrono::steady_clock::now() + patience;
        while (!thread.run([this] {
            return feeds.size() == 20 &&
                   std::all_of(feeds.begin(), feeds.end(), [](const auto& f) { return f->items.size() == 1; });
        })) {
            BOOST_REQUIRE((std::chrono::steady_clock::now() < end));
        }
    }

    side_thread thread;
    std::unique_ptr<cles::service> node;
    std::vector<std::unique_ptr<feed_log>> feeds;
};

CLES_DATA_TEST_CASE(services_of_two_threads_bind_to_each_other_at_the_same_time, carriers, kind) {
    remote_node one{"one", kind};
    remote_node two{"two", kind};
    one.bind_many(two);
    two.bind_many(one);
    one.wait_for_feeds();
    two.wait_for_feeds();
    one.thread.run([&] { one.node->stop(); });
}

// Two services with operations of every kind in progress.
struct busy_nodes {
    explicit busy_nodes(asio::io_context& context, carrier kind)
        : io(context), car(std::make_unique<cles::service>(io, listening("car1", kind))),
          tower(std::make_unique<cles::service>(io, knowing("tower", *car))) {
        car->on_pull("speed", [] { return 42; });
        car->on_delegate("drive", [this](const cles::request&, cles::responder r) { jobs.push_back(std::move(r)); });
        car->on_delegate("rest", rest);
        car->on_bind("place");
        car->update("place", 1);
        tower->async_delegate("car1:drive", cles::json_text{}, drive.options(), drive.take());
        tower->async_delegate("car1:rest", cles::json_text{}, resting.options(), resting.take());
        tower->async_pull("car1:speed", pull.options(), pull.take());
        tower->async_pull("self:cles", self.options(), self.take());
        feed.bind(*tower, "car1:place");
        thinned.bind(*tower, "car1:place/x", cles::bind_options{}.every(10ms));
        car->async_update("place", 2, update.take());
        asio::co_spawn(io, watch(), [](const std::exception_ptr&) {});
    }

    static asio::awaitable<void> rest() {
        asio::steady_timer never{co_await asio::this_coro::executor, asio::steady_timer::time_point::max()};
        co_await never.async_wait(asio::use_awaitable);
    }

    asio::awaitable<void> watch() {
        if (!tower) {
            co_return; // cancelled before this started
        }
        auto places = co_await tower->async_bind("car1:place");
        for (;;) {
            co_await places.async_next();
        }
    }

    void wait_until_all_have_ended() {
        run_until(io, [&] {
            return drive.done() && resting.done() && pull.done() && self.done() && update.done() && feed.binds == 1 &&
                   thinned.binds == 1 && (!feed.bound || feed.is_over()) && (!thinned.bound || thinned.is_over());
        });
        run_ready(io);
        BOOST_TEST(drive.calls == 1);
        BOOST_TEST(resting.calls == 1);
        BOOST_TEST(pull.calls == 1);
        BOOST_TEST(self.calls == 1);
        BOOST_TEST(update.calls == 1);
    }

    asio::io_context& io;
    std::vector<cles::responder> jobs;
    answer<> drive;
    answer<> resting;
    answer<> pull;
    answer<> self;
    answer<void> update;
    feed_log feed;
    feed_log thinned;
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> tower;
};

CLES_DATA_TEST_CASE(destroying_services_with_everything_in_flight_ends_it_all, carriers, kind) {
    for (int turns = 0; turns < 60; turns += 3) {
        asio::io_context io;
        busy_nodes n{io, kind};
        for (int i = 0; i < turns; ++i) {
            io.poll_one();
        }
        n.tower.reset();
        n.wait_until_all_have_ended();
        n.car.reset();
        run_ready(io);
    }
}

CLES_DATA_TEST_CASE(destroying_the_publisher_first_ends_all_but_the_feeds, carriers, kind) {
    for (int turns = 0; turns < 60; turns += 7) {
        asio::io_context io;
        busy_nodes n{io, kind};
        for (int i = 0; i < turns; ++i) {
            io.poll_one();
        }
        n.car.reset();
        run_until(io, [&] { return n.drive.done() && n.pull.done() && n.resting.done() && n.update.done(); });
        n.tower.reset();
        n.wait_until_all_have_ended();
    }
}

CLES_DATA_TEST_CASE(a_context_may_go_with_everything_in_flight, carriers, kind) {
    for (int turns = 0; turns < 60; turns += 7) {
        auto io = std::make_unique<asio::io_context>();
        auto n = std::make_unique<busy_nodes>(*io, kind);
        for (int i = 0; i < turns; ++i) {
            io->poll_one();
        }
        n.reset(); // its remaining completions still wait in the context
        io.reset();
    }
    BOOST_TEST(true);
}

// Of two connected services, the one whose context belongs to the host program may be destroyed with it at any moment.
CLES_DATA_TEST_CASE(a_peers_context_may_go_first, carriers, kind) {
    for (int turns = 0; turns < 12; ++turns) {
        asio::io_context io;
        cles::service car{io, listening("car1", kind)};
        car.on_pull("speed", [] { return 42; });
        answer<int> early;
        {
            asio::io_context other;
            cles::service tower{other, knowing("tower", car)};
            tower.async_pull<int>("car1:speed", early.take());
            for (int i = 0; i < turns; ++i) {
                other.poll_one();
                io.poll_one();
            }
        }
        run_ready(io);
        cles::service tower{io, knowing("tower", car)};
        answer<int> a;
        tower.async_pull<int>("car1:speed", a.take());
        run_until(io, [&] { return a.done(); });
        BOOST_TEST(a.value == 42);
    }
}

CLES_DATA_TEST_CASE(a_publishers_context_may_go_first, carriers, kind) {
    for (int turns = 0; turns < 12; ++turns) {
        asio::io_context io;
        auto other = std::make_unique<asio::io_context>();
        auto car = std::make_unique<cles::service>(*other, listening("car1", kind));
        car->on_bind("place");
        cles::service tower{io, knowing("tower", *car)};
        feed_log feed;
        feed.bind(tower, "car1:place");
        for (int i = 0; i < turns; ++i) {
            other->poll_one();
            io.poll_one();
        }
        car.reset();
        other.reset();
        answer<int> a;
        tower.async_pull<int>("car1:speed", a.take());
        run_until(io, [&] { return a.done(); });
        BOOST_TEST(a.code.failed());
    }
}

CLES_DATA_TEST_CASE(stopping_twice_and_asking_a_stopped_service_fails_with_stopped, carriers, kind) {
    asio::io_context io;
    busy_nodes n{io, kind};
    n.tower->stop();
    n.tower->stop();
    n.wait_until_all_have_ended();
    answer<> late;
    n.tower->async_pull("car1:speed", late.options(), late.take());
    BOOST_TEST(!late.done());
    run_until(io, [&] { return late.done(); });
    BOOST_TEST(late.code == errc::stopped);
    answer<void> publish;
    n.tower->async_update("place", 1, publish.take());
    run_until(io, [&] { return publish.done(); });
    BOOST_TEST(publish.code == errc::stopped);
}

// Replies are sent before the end if the peer accepts them at once.
CLES_DATA_TEST_CASE(a_stop_sends_what_was_answered, every_socket, kind) {
    asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    std::vector<cles::responder> jobs;
    car.on_delegate("drive", [&](const cles::request&, cles::responder r) { jobs.push_back(std::move(r)); });
    scripted_peer peer{io, car.endpoints().front()};
    peer.send("DELEGATE self:drive id=1\n");
    run_until(io, [&] { return jobs.size() == 1; });
    jobs.front().done(3);
    car.stop();
    BOOST_TEST(peer.rest() == "id=1 {\"value\":3}\n");
}

BOOST_AUTO_TEST_SUITE_END()
