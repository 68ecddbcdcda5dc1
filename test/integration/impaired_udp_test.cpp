// SPDX-License-Identifier: BSL-1.0
// Requests and bindings by datagram, over a network that loses, duplicates, delays and reorders them.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/impaired_path.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/steady_timer.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

BOOST_AUTO_TEST_SUITE(impaired_udp)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;
using cles::feed_event;

constexpr std::array seeds{1U, 2U, 3U};
constexpr impairment bad{.loss = 0.2, .twice = 0.2, .least_delay = 0ms, .most_delay = 30ms};

struct network {
    network(asio::io_context& context, impairment how, std::uint32_t seed, const cles::limits& bounds = {})
        : io(context), car(io, listening("car1", carrier::udp4)), path(io, car.endpoints().front(), how, seed),
          tower(io, {.name = "tower", .peers = {{"car1", path.url()}}, .limits = bounds}) {
        car.on_pull("echo", [](const cles::request& r) { return std::string{r.parameter(0)}; });
        car.on_push("effect", [this](const cles::request& r) { ++effects[std::string{r.parameter(0)}]; });
        car.on_delegate("work", [this](const cles::request& r, cles::responder done) {
            ++effects["work " + std::string{r.parameter(0)}];
            auto timer = std::make_shared<asio::steady_timer>(io, 20ms);
            timer->async_wait([timer, done](boost::system::error_code) mutable { done.done(cles::json_text{"[1]"}); });
        });
        car.on_bind("place");
    }

    asio::io_context& io;
    std::map<std::string, int> effects; // how often each request's handler ran
    cles::service car;
    impaired_path path;
    cles::service tower;
};

/// The networks of all seeds at the same time, so that a test waits only for the slowest.
struct networks {
    explicit networks(impairment how, const cles::limits& bounds = {}) {
        for (const auto seed : seeds) {
            each.push_back(std::make_unique<network>(io, how, seed, bounds));
        }
    }

    asio::io_context io;
    std::vector<std::unique_ptr<network>> each; // one per seed, in order
};

using answers = std::vector<std::unique_ptr<answer<>>>;

bool all_done(const answers& some) {
    return std::all_of(some.begin(), some.end(), [](const auto& a) { return a->done(); });
}

BOOST_AUTO_TEST_CASE(all_requests_end_and_have_their_effect_at_most_once) {
    networks all{bad};
    constexpr int count = 60;
    std::array<answers, seeds.size()> asked;
    for (std::size_t which = 0; which < seeds.size(); ++which) {
        const auto ask = [&](const std::string& command) {
            auto& made = asked[which].emplace_back(std::make_unique<answer<>>());
            all.each[which]->tower.async_request(command, made->options().deadline(15s), made->take());
        };
        for (int i = 0; i < count; ++i) {
            ask("PULL car1:echo/" + std::to_string(i));
            ask("PUSH car1:effect/" + std::to_string(i));
            ask("DELEGATE car1:work/" + std::to_string(i));
        }
    }
    run_until(all.io, [&] { return std::all_of(asked.begin(), asked.end(), all_done); });
    for (std::size_t which = 0; which < seeds.size(); ++which) {
        BOOST_TEST_CONTEXT("seed " << seeds[which]) {
            auto& n = *all.each[which];
            // Each copy and its reply may be lost: sometimes all copies of a request are, and then its deadline ends
            // it.
            int answered = 0;
            for (int i = 0; i < 3 * count; ++i) {
                const auto& a = *asked[which][static_cast<std::size_t>(i)];
                BOOST_TEST(a.calls == 1);
                BOOST_TEST((!a.code || a.code == errc::deadline), "request " << i << ": " << a.code.message());
                answered += a.code ? 0 : 1;
                const auto what = (i % 3 == 2 ? "work " : "") + std::to_string(i / 3);
                if (i % 3 != 0 && !a.code) {
                    BOOST_TEST(n.effects[what] == 1, what << " was answered and ran " << n.effects[what] << " times");
                }
            }
            BOOST_TEST(answered >= 3 * count - 5);
            for (const auto& [what, times] : n.effects) {
                BOOST_TEST(times <= 1, what << " ran " << times << " times");
            }
            // The network impaired datagrams as configured.
            BOOST_TEST(n.path.lost() > 20U);
            BOOST_TEST(n.path.doubled() > 20U);
            BOOST_TEST(n.path.to_node() > 3U * count);
        }
    }
}

BOOST_AUTO_TEST_CASE(a_network_that_loses_everything_ends_requests_with_their_deadline) {
    asio::io_context io;
    network n{io, {.loss = 1}, 1}; // the same with every seed
    answers asked;
    for (int i = 0; i < 20; ++i) {
        auto& made = asked.emplace_back(std::make_unique<answer<>>());
        n.tower.async_request("PUSH car1:effect/1", made->options().deadline(500ms), made->take());
    }
    run_until(io, [&] { return all_done(asked); });
    for (const auto& a : asked) {
        BOOST_TEST(a->code == errc::deadline);
    }
    BOOST_TEST(n.path.to_node() == 40U); // the first copies, and one retry of each: after 200 ms, and not after 600
    BOOST_TEST(n.effects.empty());
}

// The reply is lost, so the request is repeated.
BOOST_AUTO_TEST_CASE(a_lost_reply_does_not_repeat_the_effect) {
    asio::io_context io;
    network n{io, {}, 1};
    int replies = 0;
    n.path.filter([&](std::string_view, bool to_node) { return !to_node && ++replies <= 2; });
    answer<> result;
    n.tower.async_request("PUSH car1:effect/x", result.options(), result.take());
    run_until(n.io, [&] { return result.done(); });
    BOOST_TEST(!result.code);
    BOOST_TEST(n.effects["x"] == 1);
    BOOST_TEST(n.path.to_node() == 3U);
}

BOOST_AUTO_TEST_CASE(copies_are_byte_by_byte_the_same) {
    asio::io_context io;
    network n{io, {}, 1};
    std::vector<std::string> seen;
    n.path.filter([&](std::string_view datagram, bool to_node) {
        if (to_node) {
            seen.emplace_back(datagram);
        }
        return seen.size() < 3;
    });
    answer<> result;
    n.tower.async_request("PUSH car1:effect/x {\"a\":1}", result.options().deadline(4s), result.take());
    run_until(n.io, [&] { return result.done(); });
    BOOST_REQUIRE(seen.size() >= 3U);
    BOOST_TEST(seen[1] == seen[0]);
    BOOST_TEST(seen[2] == seen[0]);
    // What remains of the 4 s when it is written.
    constexpr std::string_view adverb = " deadline=";
    const auto at = seen[0].find(adverb);
    BOOST_REQUIRE(at != std::string::npos);
    const auto left = std::stoi(seen[0].substr(at + adverb.size()));
    BOOST_TEST(left <= 4000);
    BOOST_TEST(left > 1000, seen[0]);
}

CLES_DATA_TEST_CASE(feeds_report_what_was_lost_as_gaps, seeds, seed) {
    asio::io_context io;
    network n{io, {}, seed};
    feed_log feed;
    feed.bind(n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    n.car.update("place", 0); // the first update is never a gap: it has to arrive
    run_until(n.io, [&] { return feed.items.size() == 1; });
    n.path.set({.loss = 0.3, .twice = 0.3});
    constexpr int count = 300;
    for (int i = 1; i <= count; ++i) {
        n.car.update("place", i);
        run_until(n.io, [&, so_far = n.path.to_clients()] { return n.path.to_clients() > so_far; });
    }
    n.path.set({});
    n.car.update("place", count + 1); // and the last one reveals what is missing before it
    run_until(n.io, [&] {             // the gap before it has its number too
        return feed.items.back().kind == feed_event::update && feed.items.back().seq == count + 2;
    });
    BOOST_TEST(feed.count(feed_event::gap) > 10U);
    BOOST_TEST(feed.missed() > 50U);
    BOOST_TEST(feed.count(feed_event::update) + feed.missed() == count + 2U); // no duplicates, all accounted for
}

CLES_DATA_TEST_CASE(updates_that_overtake_others_are_in_order_or_gaps, seeds, seed) {
    asio::io_context io;
    network n{io, {.least_delay = 0ms, .most_delay = 20ms}, seed};
    feed_log feed;
    feed.bind(n.tower, "car1:place", cles::bind_options{}.keep(1000));
    run_until(n.io, [&] { return feed.bound; });
    for (int i = 1; i <= 200; ++i) {
        n.car.update("place", i);
    }
    run_until(n.io, [&] { return n.path.to_clients() >= 201; });
    n.path.set({});
    run_until(n.io, [&] { return !feed.items.empty(); });
    for (int i = 0; i < 30; ++i) { // until everything in transit has arrived
        run_ready(n.io);
    }
    n.car.update("place", 201);
    run_until(n.io, [&] { return feed.items.back().seq == 201; });
    std::uint64_t last = 0;
    for (const auto& item : feed.items) {
        if (item.kind == feed_event::update) {
            BOOST_TEST(item.seq > last);
            last = item.seq;
        }
    }
    BOOST_TEST(feed.count(feed_event::gap) > 0U);
}

BOOST_AUTO_TEST_CASE(feeds_stay_bound_through_losses) {
    networks all{{.loss = 0.05, .twice = 0.1, .least_delay = 0ms, .most_delay = 10ms}, {.lease = 2s}};
    std::array<feed_log, seeds.size()> feeds;
    for (std::size_t which = 0; which < seeds.size(); ++which) {
        feeds[which].bind(all.each[which]->tower, "car1:place");
    }
    run_until(all.io,
              [&] { return std::all_of(feeds.begin(), feeds.end(), [](const auto& f) { return f.binds != 0; }); });
    for (const auto& feed : feeds) {
        BOOST_REQUIRE(feed.bound);
    }
    int published = 0;
    asio::steady_timer pace{all.io};
    std::function<void()> publish = [&] {
        ++published;
        for (const auto& n : all.each) {
            n->car.update("place", published);
        }
        pace.expires_after(20ms);
        pace.async_wait([&](boost::system::error_code code) {
            if (!code) {
                publish();
            }
        });
    };
    publish();
    run_until(all.io, [&] { return published >= 150; }); // longer than a lease
    for (const auto& feed : feeds) {
        BOOST_TEST(feed.count(feed_event::update) > 50U);
        BOOST_TEST(feed.count(feed_event::lost) == 0U);
    }
    pace.cancel();
    run_ready(all.io);
}

BOOST_AUTO_TEST_SUITE_END()
