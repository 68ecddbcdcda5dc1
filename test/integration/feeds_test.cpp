// SPDX-License-Identifier: BSL-1.0
// Bindings between services: what a feed reports, through losses and restarts.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(feeds)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;
using cles::feed_event;

constexpr std::array carriers{carrier::tcp4, carrier::unix_file, carrier::inproc};
constexpr std::array two_carriers{carrier::tcp4, carrier::inproc}; // for cases that take long

struct nodes {
    explicit nodes(carrier kind) : car(std::make_unique<cles::service>(io, listening("car1", kind))) {
        tower = std::make_unique<cles::service>(io, knowing("tower", *car));
        car->on_bind("place");
    }
    void until_bound(feed_log& feed, std::string_view noun = "car1:place", const cles::bind_options& options = {}) {
        feed.bind(*tower, noun, options);
        run_until(io, [&] { return feed.binds != 0; });
        BOOST_REQUIRE_MESSAGE(feed.bound, feed.code.message() << ": " << feed.words);
    }
    cles::feed<int> bound_feed(const cles::bind_options& options = {}) {
        cles::feed<int> feed;
        tower->async_bind<int>("car1:place", options,
                               [&](boost::system::error_code, cles::feed<int> made) { feed = std::move(made); });
        run_until(io, [&] { return feed.is_open(); });
        return feed;
    }
    /// Publishes 1 to `last`, which then wait in the feeds that nobody reads.
    void queue_up_to(int last) {
        for (int i = 1; i <= last; ++i) {
            car->update("place", i);
        }
        run_ready(io);
    }
    // A publisher with the same name and address, as after a crash.
    void restart() {
        const auto where = car->endpoints().front();
        car.reset();
        run_ready(io);
        car = std::make_unique<cles::service>(io, cles::service_options{.name = "car1", .listen = {where}});
        car->on_bind("place");
    }

    boost::asio::io_context io;
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> tower;
};

std::string value(int i) { return "{\"value\":" + std::to_string(i) + "}"; }

CLES_DATA_TEST_CASE(a_feed_tells_the_current_value_and_then_every_update_in_order, carriers, kind) {
    nodes n{kind};
    n.car->update("place", 0);
    feed_log feed;
    n.until_bound(feed);
    std::vector<std::string> expected;
    for (int i = 1; i <= 50; ++i) {
        n.car->update("place", i);
        expected.push_back(value(i));
    }
    run_until(n.io, [&] { return feed.items.size() == 51; });
    BOOST_TEST((feed.items.front().kind == feed_event::current));
    BOOST_TEST(feed.items.front().value.text == value(0));
    BOOST_TEST((feed.bodies() == expected));
    BOOST_TEST(feed.items.back().seq == 51U);
    BOOST_TEST(feed.items.back().publisher == "car1");
    BOOST_TEST(feed.missed() == 0U);
}

CLES_DATA_TEST_CASE(nouns_are_bound_apart, carriers, kind) {
    nodes n{kind};
    feed_log plain;
    feed_log fast;
    n.until_bound(plain);
    n.until_bound(fast, "car1:place/fa%73t");
    n.car->update("place/fast", 1);
    n.car->update("place", 2);
    run_until(n.io, [&] { return plain.items.size() == 1 && fast.items.size() == 1; });
    BOOST_TEST(plain.items[0].value.text == value(2));
    BOOST_TEST(fast.items[0].value.text == value(1));
}

CLES_DATA_TEST_CASE(several_feeds_on_one_noun_each_get_everything, carriers, kind) {
    nodes n{kind};
    std::vector<std::unique_ptr<feed_log>> all;
    for (int i = 0; i < 4; ++i) {
        all.push_back(std::make_unique<feed_log>());
        all.back()->bind(*n.tower, "car1:place");
    }
    run_until(n.io, [&] { return std::all_of(all.begin(), all.end(), [](const auto& f) { return f->bound; }); });
    n.car->update("place", 1);
    n.car->update("place", 2);
    run_until(n.io,
              [&] { return std::all_of(all.begin(), all.end(), [](const auto& f) { return f->items.size() == 2; }); });
    all[1].reset(); // the others continue
    n.car->update("place", 3);
    run_until(n.io,
              [&] { return all[0]->items.size() == 3 && all[2]->items.size() == 3 && all[3]->items.size() == 3; });
}

BOOST_AUTO_TEST_CASE(feeds_of_one_noun_and_the_same_terms_share_a_link_and_a_binding) {
    nodes n{carrier::tcp4};
    const auto links = [&n] {
        answer<> told;
        n.tower->async_pull("car1:cles/metrics", told.take());
        run_until(n.io, [&] { return told.done(); });
        const auto at = told.value.text.find("\"links_accepted\":");
        return std::stoi(told.value.text.substr(at + 17));
    };
    n.car->update("place", 1);
    std::vector<std::unique_ptr<feed_log>> all;
    for (int i = 0; i < 20; ++i) {
        all.push_back(std::make_unique<feed_log>());
        n.until_bound(*all.back());
        run_until(n.io, [&] { return !all.back()->items.empty(); });
        BOOST_TEST(all.back()->items.front().value.text == value(1));
    }
    BOOST_TEST(links() == 1);
    n.car->update("place", 2);
    const auto all_have = [&](std::size_t count) {
        return std::all_of(all.begin(), all.end(), [count](const auto& f) { return f->bodies().size() == count; });
    };
    run_until(n.io, [&] { return all_have(1); });
    all.erase(all.begin(), all.begin() + 19); // including the one that made it
    run_ready(n.io);
    n.car->update("place", 3);
    run_until(n.io, [&] { return all_have(2); });
    feed_log thinned; // its terms differ
    n.until_bound(thinned, "car1:place", cles::bind_options{}.every(10ms));
    BOOST_TEST(links() == 2);
    all.clear();
    thinned.close();
    run_ready(n.io);
    n.car->update("place", 4);
    run_ready(n.io);
    answer<> told;
    n.tower->async_pull("self:cles/metrics", told.take());
    run_until(n.io, [&] { return told.done(); });
    BOOST_TEST(told.value.text.find("\"updates_dropped\":0,") != std::string::npos, told.value.text);
}

CLES_DATA_TEST_CASE(feeds_that_share_a_binding_come_back_together, two_carriers, kind) {
    nodes n{kind};
    feed_log one;
    feed_log two;
    n.until_bound(one);
    n.until_bound(two);
    n.restart();
    n.car->update("place", 1);
    for (const auto* each : {&one, &two}) {
        run_until(n.io, [&] { return each->count(feed_event::rebound) == 1; });
        BOOST_TEST(each->count(feed_event::lost) == 1U);
        run_until(n.io, [&] { return each->items.back().value.text == value(1); });
    }
    n.car->update("place", 2);
    run_until(n.io, [&] { return one.bodies().size() == 1 && two.bodies().size() == 1; });
    BOOST_TEST(one.bodies().back() == value(2));
    BOOST_TEST(two.bodies().back() == value(2));
}

CLES_DATA_TEST_CASE(a_closed_feed_is_unbound_at_the_publisher, carriers, kind) {
    nodes n{kind};
    feed_log feed;
    n.until_bound(feed);
    feed.close();
    run_until(n.io, [&] { return feed.is_over(); });
    BOOST_TEST(feed.code == errc::cancelled);
    run_ready(n.io);
    n.car->update("place", 1);
    run_ready(n.io);
    BOOST_TEST(feed.items.empty());
    const auto metrics = n.car->request("PULL self:cles/metrics");
    BOOST_TEST(metrics.find("\"updates_delivered\":0") != std::string::npos, metrics);
    feed_log again;
    n.until_bound(again);
    run_until(n.io, [&] { return again.items.size() == 1; });
}

CLES_DATA_TEST_CASE(a_bind_that_is_refused_fails_with_the_publishers_message, carriers, kind) {
    nodes n{kind};
    feed_log none;
    none.bind(*n.tower, "car1:altitude");
    feed_log wrong;
    wrong.bind(*n.tower, "car1:place//");
    feed_log nobody;
    nobody.bind(*n.tower, "nobody:place");
    run_until(n.io, [&] { return none.binds != 0 && wrong.binds != 0 && nobody.binds != 0; });
    BOOST_TEST(none.code == errc::no_task);
    BOOST_TEST(none.words == "car1 has no BIND 'altitude'");
    BOOST_TEST(wrong.code == errc::bad_request);
    BOOST_TEST(nobody.code == errc::no_target, nobody.code.message());
}

CLES_DATA_TEST_CASE(every_thins_without_gaps, carriers, kind) {
    nodes n{kind};
    feed_log feed;
    n.until_bound(feed, "car1:place", cles::bind_options{}.every(30ms));
    for (int i = 1; i <= 100; ++i) {
        n.car->update("place", i);
        run_until(n.io,
                  [end = std::chrono::steady_clock::now() + 1ms] { return std::chrono::steady_clock::now() > end; });
    }
    run_until(n.io, [&] { return !feed.items.empty() && feed.items.back().value.text == value(100); });
    BOOST_TEST(feed.items.size() < 60U);
    BOOST_TEST(feed.count(feed_event::gap) == 0U);
}

CLES_DATA_TEST_CASE(a_feed_that_is_not_fetched_keeps_the_newest_and_shows_a_gap, carriers, kind) {
    nodes n{kind};
    n.tower = std::make_unique<cles::service>(n.io, knowing("tower", *n.car, {.feed = 10}));
    feed_log feed;
    feed.hold(true);
    n.until_bound(feed, "car1:place", cles::bind_options{}.keep(100));
    for (int i = 1; i <= 50; ++i) {
        n.car->update("place", i);
    }
    run_ready(n.io);
    feed.hold(false);
    run_until(n.io, [&] { return !feed.items.empty() && feed.items.back().value.text == value(50); });
    BOOST_TEST((feed.items.front().kind == feed_event::gap));
    BOOST_TEST(feed.missed() == 40U);
    BOOST_TEST(feed.count(feed_event::update) == 10U);
}

CLES_DATA_TEST_CASE(a_publisher_that_is_lost_and_returns_is_bound_again, carriers, kind) {
    nodes n{kind};
    n.car->update("place", 1);
    feed_log feed;
    n.until_bound(feed);
    run_until(n.io, [&] { return feed.items.size() == 1; });
    n.restart();
    run_until(n.io, [&] { return feed.count(feed_event::lost) == 1; });
    BOOST_TEST(!feed.items.back().text.empty());
    run_until(n.io, [&] { return feed.count(feed_event::rebound) == 1; });
    n.car->update("place", 7);
    run_until(n.io, [&] { return feed.items.back().value.text == value(7); });
    BOOST_TEST(feed.items.back().seq == 1U);
    BOOST_TEST(feed.count(feed_event::gap) == 0U); // the first update of a new incarnation is not a gap
    BOOST_TEST(feed.count(feed_event::lost) == 1U);

    n.restart(); // and again
    run_until(n.io, [&] { return feed.count(feed_event::rebound) == 2; });
    BOOST_TEST(feed.count(feed_event::lost) == 2U);
}

CLES_DATA_TEST_CASE(a_feed_keeps_trying_while_the_publisher_is_away, two_carriers, kind) {
    nodes n{kind};
    feed_log feed;
    n.until_bound(feed);
    const auto where = n.car->endpoints().front();
    n.car.reset();
    run_until(n.io, [&] { return feed.count(feed_event::lost) == 1; });
    // Long enough for some attempts to be refused.
    run_until(n.io,
              [end = std::chrono::steady_clock::now() + 350ms] { return std::chrono::steady_clock::now() > end; });
    BOOST_TEST(feed.items.size() == 1U);
    n.car = std::make_unique<cles::service>(n.io, cles::service_options{.name = "car1", .listen = {where}});
    n.car->on_bind("place");
    run_until(n.io, [&] { return feed.count(feed_event::rebound) == 1; });
}

CLES_DATA_TEST_CASE(a_publisher_that_returns_without_the_task_is_tried_again, two_carriers, kind) {
    nodes n{kind};
    feed_log feed;
    n.until_bound(feed);
    const auto where = n.car->endpoints().front();
    n.car.reset();
    run_ready(n.io);
    n.car = std::make_unique<cles::service>(n.io, cles::service_options{.name = "car1", .listen = {where}});
    run_until(n.io, [&] { return feed.count(feed_event::lost) == 1; });
    run_until(n.io,
              [end = std::chrono::steady_clock::now() + 250ms] { return std::chrono::steady_clock::now() > end; });
    BOOST_TEST(!feed.is_over());
    n.car->on_bind("place");
    run_until(n.io, [&] { return feed.count(feed_event::rebound) == 1; });
}

CLES_DATA_TEST_CASE(stopping_the_binders_service_ends_its_feeds, carriers, kind) {
    nodes n{kind};
    feed_log waiting;
    n.until_bound(waiting);
    feed_log binding; // its reply is still in transit
    binding.bind(*n.tower, "car1:place/fast");
    n.tower->stop();
    run_until(n.io, [&] { return waiting.is_over() && binding.binds == 1; });
    BOOST_TEST(waiting.code == errc::stopped);
    BOOST_TEST(binding.code == errc::stopped);
    feed_log after;
    after.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return after.binds == 1; });
    BOOST_TEST(after.code == errc::stopped);
}

CLES_DATA_TEST_CASE(a_feed_outlives_its_service_and_fails_with_stopped, carriers, kind) {
    nodes n{kind};
    cles::feed<cles::json_text> feed;
    n.tower->async_bind("car1:place",
                        [&](boost::system::error_code, cles::feed<cles::json_text> made) { feed = std::move(made); });
    run_until(n.io, [&] { return feed.is_open(); });
    n.tower.reset();
    run_ready(n.io);
    boost::system::error_code code;
    feed.async_next([&](boost::system::error_code failed, const cles::feed_item<cles::json_text>&) { code = failed; });
    run_until(n.io, [&] { return code.failed(); });
    BOOST_TEST(code == errc::stopped);
}

// More than are delivered in one function.
CLES_DATA_TEST_CASE(a_handler_that_waits_again_gets_all_events_also_if_it_throws, carriers, kind) {
    nodes n{kind};
    auto feed = n.bound_feed(cles::bind_options{}.keep(100));
    std::vector<int> expected(50);
    std::iota(expected.begin(), expected.end(), 1);
    n.queue_up_to(50);
    std::vector<int> got;
    std::function<void(boost::system::error_code, const cles::feed_item<int>&)> take =
        [&](boost::system::error_code, const cles::feed_item<int>& item) {
            got.push_back(item.value);
            if (got.size() < expected.size()) {
                feed.async_next(take);
            }
            if (got.size() % 5 == 0) {
                throw std::runtime_error("a handler's");
            }
        };
    feed.async_next(take);
    int thrown = 0;
    boost::asio::io_context idle;
    run_until(idle, [&] {
        try {
            n.io.restart();
            n.io.poll();
        } catch (const std::runtime_error&) {
            ++thrown;
        }
        return got.size() == expected.size();
    });
    BOOST_TEST((got == expected));
    BOOST_TEST(thrown == 10);
}

BOOST_AUTO_TEST_CASE(one_function_delivers_several_events_that_wait) {
    nodes n{carrier::inproc};
    auto slow = n.bound_feed();
    n.queue_up_to(48);
    int got = 0;
    std::function<void(boost::system::error_code, const cles::feed_item<int>&)> take =
        [&](boost::system::error_code, const cles::feed_item<int>&) {
            if (++got != 48) {
                slow.async_next(take);
            }
        };
    slow.async_next(take);
    n.io.restart();
    int functions = 0;
    while (got != 48 && n.io.poll_one() != 0) {
        ++functions;
    }
    BOOST_TEST(got == 48);
    BOOST_TEST(functions < 16); // one is needed, and others may be due
}

BOOST_DATA_TEST_CASE(a_handler_may_wait_again_and_then_end_its_feed,
                     boost::unit_test::data::make({"close", "destroy", "stop", "destroy the service", "cancel"}), how) {
    nodes n{carrier::tcp4};
    auto feed = std::make_unique<cles::feed<int>>(n.bound_feed());
    n.queue_up_to(3);
    const std::string what = how;
    boost::asio::cancellation_signal signal;
    std::vector<boost::system::error_code> second;
    int first = 0;
    feed->async_next([&](boost::system::error_code, const cles::feed_item<int>& item) {
        first = item.value;
        feed->async_next(boost::asio::bind_cancellation_slot(
            signal.slot(),
            [&](boost::system::error_code code, const cles::feed_item<int>&) { second.push_back(code); }));
        if (what == "close") {
            feed->close();
        } else if (what == "destroy") {
            feed.reset();
        } else if (what == "stop") {
            n.tower->stop();
        } else if (what == "destroy the service") {
            n.tower.reset();
        } else {
            signal.emit(boost::asio::cancellation_type::terminal);
        }
    });
    run_until(n.io, [&] { return !second.empty(); });
    run_ready(n.io);
    BOOST_TEST(first == 1);
    BOOST_TEST(second.size() == 1U);
    const bool stops = what == "stop" || what == "destroy the service";
    BOOST_TEST(second.front() == (stops ? errc::stopped : errc::cancelled));
}

BOOST_AUTO_TEST_CASE(a_handler_may_run_the_executor_until_the_next_event_comes) {
    nodes n{carrier::tcp4};
    auto feed = n.bound_feed();
    n.queue_up_to(3);
    std::vector<int> got;
    feed.async_next([&](boost::system::error_code, const cles::feed_item<int>& first) {
        got.push_back(first.value);
        feed.async_next([&](boost::system::error_code, const cles::feed_item<int>& second) {
            got.push_back(second.value);
            feed.async_next(
                [&](boost::system::error_code, const cles::feed_item<int>& third) { got.push_back(third.value); });
        });
        run_until(n.io, [&] { return got.size() == 3; });
    });
    run_until(n.io, [&] { return got.size() == 3; });
    BOOST_TEST((got == std::vector<int>{1, 2, 3}));
}

BOOST_AUTO_TEST_CASE(cancelling_a_wait_leaves_the_feed_as_it_was) {
    nodes n{carrier::tcp4};
    auto feed = n.bound_feed();
    std::vector<std::pair<boost::system::error_code, int>> got;
    const auto take = [&](boost::system::error_code code, const cles::feed_item<int>& item) {
        got.emplace_back(code, item.value);
    };
    boost::asio::cancellation_signal signal;
    feed.async_next(boost::asio::bind_cancellation_slot(signal.slot(), take));
    feed.async_next(take); // one at a time
    run_until(n.io, [&] { return got.size() == 1; });
    BOOST_TEST(got.back().first == errc::busy);
    signal.emit(boost::asio::cancellation_type::total);
    run_until(n.io, [&] { return got.size() == 2; });
    BOOST_TEST(got.back().first == errc::cancelled);
    n.car->update("place", 1);
    n.car->update("place", 2);
    for (const int expected : {1, 2}) {
        feed.async_next(take);
        run_until(n.io, [&] { return got.size() == 2U + static_cast<std::size_t>(expected); });
        BOOST_TEST(got.back().second == expected);
    }
}

BOOST_AUTO_TEST_CASE(cancelling_a_bind_withdraws_it) {
    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower", .peers = {{"car1", listener.url()}}}};
    boost::asio::cancellation_signal signal;
    std::vector<boost::system::error_code> codes;
    tower.async_bind("car1:place",
                     boost::asio::bind_cancellation_slot(
                         signal.slot(), [&](boost::system::error_code code, const cles::feed<cles::json_text>&) {
                             codes.push_back(code);
                         }));
    auto publisher = listener.accept();
    BOOST_TEST(publisher.line().starts_with("BIND car1:place id="));
    signal.emit(boost::asio::cancellation_type::terminal);
    run_until(io, [&] { return codes.size() == 1; });
    BOOST_TEST(codes.front() == errc::cancelled);
    const auto next = publisher.line(); // by the id of the BIND, or by an unbind: it must not stay bound
    BOOST_TEST((next.find("lease=0") != std::string::npos || next.find("cles/cancel/") != std::string::npos), next);
    run_ready(io);
    BOOST_TEST(codes.size() == 1U);
}

// -- against a scripted publisher ----------------------------------------------------------------------------------

// Replies to the next BIND; returns it.
std::string answer_bind(scripted_peer& publisher, std::string_view last = "{}") {
    const auto asked = publisher.line();
    const auto at = asked.find("id=");
    const auto id = asked.substr(at, asked.find(' ', at) - at);
    publisher.send(id + " " + std::string{last} + "\n");
    return asked;
}

std::string update(int seq, std::string_view epoch, int value) {
    return "UPDATE car1:place seq=" + std::to_string(seq) + " epoch=" + std::string{epoch} +
           " {\"value\":" + std::to_string(value) + "}\n";
}

std::string id_of(const std::string& request) {
    const auto at = request.find("id=");
    return request.substr(at, request.find(' ', at) - at);
}

// A bound feed, and one that joins it, at a publisher that lists its features.
struct joined {
    explicit joined(std::string_view features, const cles::bind_options& options = {}) {
        one.bind(tower, "car1:place");
        publisher = std::make_unique<scripted_peer>(listener.accept());
        answer_bind(*publisher);
        run_until(io, [&] { return one.bound; });
        two.bind(tower, "car1:place", options);
        const auto asked = publisher->line();
        BOOST_TEST(asked.starts_with("PULL self:cles id="), asked);
        publisher->send(id_of(asked) + " {\"features\":" + std::string{features} + "}\n");
        asked_again = publisher->line();
        BOOST_TEST(asked_again.starts_with("BIND car1:place id="), asked_again);
    }

    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower", .peers = {{"car1", listener.url()}}}};
    feed_log one;
    feed_log two;
    std::unique_ptr<scripted_peer> publisher;
    std::string asked_again;
};

// What is queued for the link is older than the value in the reply to the second BIND.
BOOST_AUTO_TEST_CASE(a_feed_that_joins_gets_nothing_older_than_its_current_value) {
    joined at{R"(["mark"])"};
    BOOST_TEST(at.asked_again.find(" mark=yes") != std::string::npos, at.asked_again);
    at.publisher->send(id_of(at.asked_again) + " seq=10 epoch=0000000a " + value(10) + "\n" + update(9, "0000000a", 9) +
                       update(10, "0000000a", 10) + update(11, "0000000a", 11));
    run_until(at.io, [&] { return at.one.bodies().size() == 3 && at.two.bodies().size() == 1; });
    BOOST_TEST((at.two.items.front().kind == feed_event::current));
    BOOST_TEST(at.two.items.front().value.text == value(10));
    BOOST_TEST(at.two.bodies().front() == value(11));
    BOOST_TEST(at.two.missed() == 0U);
    feed_log third; // the publisher is asked once for its features
    third.bind(at.tower, "car1:place");
    const auto asked = answer_bind(*at.publisher);
    BOOST_TEST(asked.starts_with("BIND car1:place id="), asked);
    run_until(at.io, [&] { return third.bound; });
}

BOOST_AUTO_TEST_CASE(a_feed_that_wants_marks_knows_which_update_its_current_value_is) {
    joined at{R"(["mark"])", cles::bind_options{}.mark()};
    at.publisher->send(id_of(at.asked_again) + " seq=10 epoch=0000000a " + value(10) + "\n" +
                       update(11, "0000000a", 11));
    run_until(at.io, [&] { return at.two.bodies().size() == 1; });
    BOOST_REQUIRE(at.two.items.size() == 2U);
    BOOST_TEST(at.two.items.front().seq == 10U);
    BOOST_TEST(at.two.items.front().epoch == 10U);
    BOOST_TEST(at.two.items.back().seq == 11U);
    BOOST_TEST(at.two.items.back().epoch == 10U);
}

BOOST_AUTO_TEST_CASE(a_feed_that_joins_and_is_refused_leaves_the_other_bound) {
    joined at{"[]"};
    BOOST_TEST(at.asked_again.find(" mark=yes") == std::string::npos, at.asked_again);
    at.publisher->send(id_of(at.asked_again) + R"( {"error":"denied","message":"no"})" + "\n");
    run_until(at.io, [&] { return at.two.binds == 1; });
    BOOST_TEST(at.two.code == errc::denied);
    at.publisher->send(update(1, "0000000a", 1));
    run_until(at.io, [&] { return at.one.bodies().size() == 1; });
    at.one.close();
    const auto next = at.publisher->line(); // nothing has been unbound before
    BOOST_TEST(next.find("lease=0") != std::string::npos, next);
}

BOOST_AUTO_TEST_CASE(a_feed_that_is_refused_unbinds_what_another_has_left_to_it) {
    joined at{"[]"};
    at.one.close(); // the binding remains for the other
    run_ready(at.io);
    at.publisher->send(id_of(at.asked_again) + R"( {"error":"busy","message":"no"})" + "\n");
    run_until(at.io, [&] { return at.two.binds == 1; });
    const auto next = at.publisher->line();
    BOOST_TEST(next.find("lease=0") != std::string::npos, next);
}

BOOST_AUTO_TEST_CASE(a_feed_that_joins_has_a_deadline_of_its_own) {
    joined at{"[]", cles::bind_options{}.deadline(50ms)};
    run_until(at.io, [&] { return at.two.binds == 1; });
    BOOST_TEST(at.two.code == errc::deadline);
    at.publisher->send(id_of(at.asked_again) + " {}\n" + update(1, "0000000a", 1));
    run_until(at.io, [&] { return at.one.bodies().size() == 1; });
    at.one.close();
    const auto next = at.publisher->line();
    BOOST_TEST(next.find("lease=0") != std::string::npos, next);
}

BOOST_AUTO_TEST_CASE(a_feed_that_joins_may_be_cancelled_before_it_is_bound) {
    joined at{"[]"};
    {
        boost::asio::cancellation_signal signal;
        int ended = 0;
        at.tower.async_bind("car1:place",
                            boost::asio::bind_cancellation_slot(
                                signal.slot(), [&](boost::system::error_code code, const cles::feed<cles::json_text>&) {
                                    BOOST_TEST(code == errc::cancelled);
                                    ++ended;
                                }));
        const auto third = at.publisher->line();
        signal.emit(boost::asio::cancellation_type::terminal);
        run_until(at.io, [&] { return ended == 1; });
        at.publisher->send(id_of(at.asked_again) + " " + value(1) + "\n" + id_of(third) + " {}\n" +
                           update(2, "0000000a", 2));
    }
    run_until(at.io, [&] { return at.one.bodies().size() == 1 && at.two.bodies().size() == 1; });
    BOOST_TEST(at.two.items.front().value.text == value(1));
    at.one.close();
    at.two.close();
    const auto next = at.publisher->line();
    BOOST_TEST(next.find("lease=0") != std::string::npos, next);
}

BOOST_AUTO_TEST_CASE(what_is_missing_shows_as_a_gap_and_what_is_old_does_not_show) {
    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower", .peers = {{"car1", listener.url()}}}};
    feed_log feed;
    feed.bind(tower, "car1:place", cles::bind_options{}.keep(7).every(0ms));
    auto publisher = listener.accept();
    const auto asked = answer_bind(publisher, R"({"value":0})");
    BOOST_TEST(asked.starts_with("BIND car1:place id="), asked);
    BOOST_TEST(asked.find(" keep=7") != std::string::npos, asked);
    publisher.send(update(5, "0000000a", 5) + update(6, "0000000a", 6) + update(9, "0000000a", 9) +
                   update(9, "0000000a", 9) + update(7, "0000000a", 7) + update(1, "0000000b", 1) +
                   update(10, "0000000a", 10) + update(2, "0000000b", 2));
    run_until(io, [&] { return feed.items.size() == 7; });
    std::string kinds;
    for (const auto& i : feed.items) {
        kinds += i.kind == feed_event::gap ? "gap" + std::to_string(i.missed) + " " : i.value.text;
    }
    BOOST_TEST(kinds == R"({"value":0}{"value":5}{"value":6}gap2 {"value":9}{"value":1}{"value":2})");
}

BOOST_AUTO_TEST_CASE(an_update_that_does_not_fit_fails_and_the_next_one_is_there) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1")};
    car.on_bind("place");
    cles::service tower{io, knowing("tower", car)};
    cles::feed<int> feed;
    tower.async_bind<int>("car1:place",
                          [&](boost::system::error_code, cles::feed<int> made) { feed = std::move(made); });
    run_until(io, [&] { return feed.is_open(); });
    car.update("place", "north");
    car.update("place", 3);
    std::vector<std::pair<boost::system::error_code, int>> got;
    for (std::size_t i = 1; i <= 2; ++i) {
        feed.async_next([&](boost::system::error_code code, const cles::feed_item<int>& item) {
            got.emplace_back(code, item.value);
        });
        run_until(io, [&] { return got.size() == i; });
    }
    BOOST_TEST(got[0].first == errc::conversion);
    BOOST_TEST(got[1].second == 3);
}

BOOST_AUTO_TEST_CASE(tries_to_bind_again_back_off) {
    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower", .peers = {{"car1", listener.url()}}}};
    feed_log feed;
    feed.bind(tower, "car1:place");
    std::vector<std::chrono::steady_clock::time_point> tries;
    for (int i = 0; i < 5; ++i) {
        auto publisher = listener.accept();
        tries.push_back(std::chrono::steady_clock::now());
        if (i == 0) {
            answer_bind(publisher);
            run_until(io, [&] { return feed.bound; });
        } else {
            publisher.line(); // and disconnects
        }
    }
    for (std::size_t i = 1; i < tries.size(); ++i) { // 100, 200, 400, 800 ms, each shortened by up to a quarter
        BOOST_TEST((tries[i] - tries[i - 1]).count() >= (75'000'000LL << (i - 1)));
    }
    BOOST_TEST(feed.count(feed_event::lost) == 1U); // reported once
}

BOOST_AUTO_TEST_CASE(a_bind_whose_answer_does_not_come_is_withdrawn_at_the_publisher) {
    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower", .peers = {{"car1", listener.url()}}}};
    feed_log feed;
    feed.bind(tower, "car1:place", cles::bind_options{}.deadline(50ms));
    auto publisher = listener.accept();
    publisher.line();
    run_until(io, [&] { return feed.binds == 1; });
    BOOST_TEST(feed.code == errc::deadline);
    const auto next = publisher.line(); // otherwise it might send updates for ever
    BOOST_TEST(next.find("lease=0") != std::string::npos, next);
}

BOOST_AUTO_TEST_SUITE_END()
