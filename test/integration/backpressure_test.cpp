// SPDX-License-Identifier: BSL-1.0
// Peers that read slowly or not at all, and more peers than the limits allow.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/metric.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/post.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(backpressure)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;
using cles::feed_event;

constexpr std::array carriers{carrier::tcp4, carrier::unix_file, carrier::inproc};

// Publishes one update after another, each when the previous one has been accepted.
struct steady_publisher {
    cles::service& from;
    int count;
    std::string padding{};
    int done = 0;
    boost::system::error_code code{};

    void go() {
        from.async_update("place", std::to_string(done + 1) + padding, [this](boost::system::error_code failed) {
            code = failed;
            if (!failed && ++done < count) {
                go();
            }
        });
    }
};

CLES_DATA_TEST_CASE(async_update_waits_for_capacity_so_that_all_is_delivered, carriers, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    cles::service tower{io, knowing("tower", car)};
    car.on_bind("place");
    constexpr int count = 3000;
    feed_log small;
    feed_log large;
    small.bind(tower, "car1:place", cles::bind_options{}.keep(3));
    large.bind(tower, "car1:place/x");
    run_until(io, [&] { return small.bound && large.bound; });
    steady_publisher publisher{car, count};
    publisher.go();
    run_until(io, [&] { return small.items.size() == count; });
    BOOST_TEST(!publisher.code);
    BOOST_TEST(publisher.done == count);
    BOOST_TEST(small.missed() == 0U);
    BOOST_TEST(metric(car, "updates_shed") == 0U);
}

CLES_DATA_TEST_CASE(async_update_waits_for_a_peer_that_does_not_read, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    car.on_bind("place");
    scripted_peer peer{io, car.endpoints().front(), buffers::small};
    BOOST_TEST(peer.ask("BIND self:place keep=4") == "{}");
    constexpr int count = 400;
    steady_publisher publisher{car, count, std::string(50000, '.')};
    publisher.go();
    run_ready(io);
    BOOST_TEST(publisher.done < count);
    for (int i = 1; i <= count; ++i) {
        const auto line = peer.line();
        BOOST_REQUIRE(line.starts_with("UPDATE car1:place seq=" + std::to_string(i) + " "));
    }
    run_until(io, [&] { return publisher.done == count; });
}

CLES_DATA_TEST_CASE(async_update_ends_with_its_service_and_continues_without_a_lost_subscriber, every_socket, kind) {
    boost::asio::io_context io;
    auto car = std::make_unique<cles::service>(io, listening("car1", kind));
    car->on_bind("place");
    const auto stuck_binder = [&] {
        scripted_peer peer{io, car->endpoints().front(), buffers::small};
        peer.ask("BIND self:place keep=1");
        return peer;
    };
    auto peer = stuck_binder();
    steady_publisher publisher{*car, 300, std::string(50000, '.')};
    publisher.go();
    run_ready(io);
    BOOST_TEST(publisher.done < 300);
    peer.reset();
    run_until(io, [&] { return publisher.done == 300; });

    auto other = stuck_binder();
    steady_publisher second{*car, 300, std::string(50000, '.')};
    second.go();
    run_ready(io);
    BOOST_TEST(second.done < 300);
    car.reset();
    run_until(io, [&] { return second.code.failed(); });
    BOOST_TEST(second.code == errc::stopped);
}

// Many waiting publications continue in one turn.
BOOST_AUTO_TEST_CASE(publishers_do_not_delay_each_other) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::inproc)};
    std::vector<std::unique_ptr<steady_publisher>> all;
    for (int i = 0; i < 30; ++i) {
        all.push_back(std::make_unique<steady_publisher>(car, i == 0 ? 1'000'000 : 20));
        all.back()->go();
    }
    bool other_ran = false;
    boost::asio::post(io, [&] { other_ran = true; });
    run_until(io, [&] { return std::all_of(all.begin() + 1, all.end(), [](const auto& p) { return p->done == 20; }); });
    BOOST_TEST(other_ran);
    BOOST_TEST(all[0]->done < 1000);
    BOOST_TEST(metric(car, "updates_published") >= 29U * 20U);
    car.stop();
    run_until(io, [&] { return all[0]->code.failed(); });
    BOOST_TEST(all[0]->code == errc::stopped);
}

BOOST_AUTO_TEST_CASE(a_publisher_that_throws_ends_the_turn_and_no_other_publisher) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::inproc)};
    int ends = 0;
    for (int i = 0; i < 3; ++i) {
        car.async_update("place", i, [&](boost::system::error_code failed) {
            BOOST_TEST(!failed);
            if (++ends == 2) {
                throw std::runtime_error("a handler's");
            }
        });
    }
    BOOST_TEST(ends == 0); // never inside the call
    BOOST_CHECK_THROW(run_until(io, [&] { return ends == 3; }), std::runtime_error);
    BOOST_TEST(ends == 2);
    run_until(io, [&] { return ends == 3; });
}

// Both wait, and continue as soon as they can.
CLES_DATA_TEST_CASE(a_lost_binder_sets_no_two_publishers_on_each_other, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    car.on_bind("place");
    scripted_peer peer{io, car.endpoints().front(), buffers::small};
    peer.ask("BIND self:place keep=1");
    const std::string padding(50000, '.');
    steady_publisher one{car, 1'000'000, padding};
    steady_publisher other{car, 1'000'000, padding};
    one.go();
    other.go();
    run_ready(io);
    const int before = one.done;
    bool other_ran = false;
    peer.reset();
    run_until(io, [&] { return one.done > before; });
    boost::asio::post(io, [&] { other_ran = true; });
    run_until(io, [&] { return other_ran; });
    BOOST_TEST(one.done < 10'000);
    car.stop();
    run_until(io, [&] { return one.code.failed() && other.code.failed(); });
}

CLES_DATA_TEST_CASE(a_publisher_that_waited_may_throw_an_error_of_ours, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    car.on_bind("place");
    scripted_peer peer{io, car.endpoints().front(), buffers::small};
    peer.ask("BIND self:place keep=1");
    steady_publisher filling{car, 300, std::string(50000, '.')};
    filling.go();
    run_ready(io);
    BOOST_TEST(filling.done < 300);
    car.async_update("place", 1, [&](boost::system::error_code) { car.update("no such noun", 1); });
    peer.reset();
    BOOST_CHECK_THROW(run_until(io, [&] { return filling.done == 300; }), cles::error);
    run_until(io, [&] { return filling.done == 300; });
}

BOOST_AUTO_TEST_CASE(publishers_of_a_noun_go_on_in_their_order) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4)};
    cles::service tower{io, knowing("tower", car)};
    car.on_bind("place");
    feed_log feed;
    feed.bind(tower, "car1:place", cles::bind_options{}.keep(24));
    run_until(io, [&] { return feed.bound; });
    std::vector<int> order;
    for (int i = 0; i < 60; ++i) {
        car.async_update("place", i, [&order, i](boost::system::error_code) { order.push_back(i); });
    }
    run_until(io, [&] { return order.size() == 60 && feed.items.size() == 60; });
    BOOST_TEST(std::is_sorted(order.begin(), order.end()));
    BOOST_TEST(feed.missed() == 0U);
}

CLES_DATA_TEST_CASE(the_last_update_is_sent_before_the_service_ends, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    cles::service tower{io, knowing("tower", car)};
    car.on_bind("place");
    feed_log feed;
    feed.bind(tower, "car1:place");
    run_until(io, [&] { return feed.bound; });
    car.update("place", 7);
    car.stop();
    run_until(io, [&] { return feed.count(feed_event::update) == 1; });
}

BOOST_AUTO_TEST_CASE(what_was_published_before_the_end_was_published) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::inproc)};
    int good = 0;
    for (int i = 0; i < 3; ++i) {
        car.async_update("place", i, [&](boost::system::error_code failed) {
            good += failed ? 0 : 1;
            car.stop();
        });
    }
    run_until(io, [&] { return good == 3; });
}

CLES_DATA_TEST_CASE(a_slow_subscriber_delays_no_other_and_gets_the_newest, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    cles::service tower{io, knowing("tower", car)};
    car.on_bind("place");
    scripted_peer slow{io, car.endpoints().front(), buffers::small};
    BOOST_TEST(slow.ask("BIND self:place keep=5") == "{}");
    feed_log quick;
    quick.bind(tower, "car1:place", cles::bind_options{}.keep(1000));
    run_until(io, [&] { return quick.bound; });
    constexpr std::size_t count = 300;
    const std::string padding(60000, '.');
    for (std::size_t i = 1; i <= count; ++i) {
        car.update("place", std::to_string(i) + padding);
        run_until(io, [&] { return quick.items.size() == i; });
    }
    BOOST_TEST(quick.missed() == 0U);
    std::uint64_t last = 0;
    std::uint64_t lines = 0;
    while (last != count) {
        const auto line = slow.line();
        const auto seq = std::stoull(line.substr(line.find("seq=") + 4));
        BOOST_REQUIRE(seq > last);
        last = seq;
        ++lines;
    }
    BOOST_TEST(lines < count);
    BOOST_TEST(metric(car, "updates_shed") == count - lines);
    BOOST_TEST(slow.ask("PULL self:cles").starts_with("{\"node\""));
}

CLES_DATA_TEST_CASE(a_peer_that_never_reads_its_replies_is_not_read_and_then_closed, every_socket, kind) {
    boost::asio::io_context io;
    std::vector<std::string> said;
    auto options = listening("car1", kind, {.unread = 100'000, .stall = 150ms});
    options.log = [&](cles::log_level level, std::string_view text) {
        if (level == cles::log_level::warning) {
            said.emplace_back(text);
        }
    };
    cles::service car{io, options};
    int ran = 0;
    car.on_pull("much", [&] {
        ++ran;
        return std::string(10'000, 'x');
    });
    scripted_peer greedy{io, car.endpoints().front(), buffers::small};
    std::string many;
    for (int i = 0; i < 20000; ++i) {
        many += "PULL self:much\n";
    }
    bool closed = false;
    std::string_view left = many;
    run_until(io, [&] {
        try {
            left.remove_prefix(greedy.send_some(left));
        } catch (const std::system_error&) {
            closed = true;
        }
        return closed || !said.empty();
    });
    run_until(io, [&] { return !said.empty(); }); // called after the link was closed
    BOOST_TEST(ran < 2000);
    BOOST_REQUIRE(said.size() == 1U);
    BOOST_TEST(said.front().find("reads nothing") != std::string::npos, said.front());
    run_until(io, [&] { return greedy.ended(); });
    scripted_peer other{io, car.endpoints().front()};
    BOOST_TEST(other.ask("PULL self:much id=1").starts_with("id=1 "));
}

CLES_DATA_TEST_CASE(a_peer_that_reads_slowly_gets_everything, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind, {.unread = 20'000, .stall = 10s})};
    car.on_pull("much", [](const cles::request& r) { return std::string(r.parameter(0)) + std::string(10'000, 'x'); });
    scripted_peer slow{io, car.endpoints().front(), buffers::small};
    for (int i = 0; i < 200; ++i) {
        slow.send("PULL self:much/" + std::to_string(i) + "\n");
    }
    for (int i = 0; i < 200; ++i) {
        BOOST_REQUIRE(slow.line().starts_with("{\"value\":\"" + std::to_string(i) + "x"));
    }
}

// A link that is paused at a limit must resume, with every transport.
CLES_DATA_TEST_CASE(small_limits_hold_back_and_let_go, carriers, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind, {.unread = 100, .waiting = 100})};
    cles::service tower{io, knowing("tower", car, {.unread = 100, .waiting = 100})};
    car.on_push("echo", [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; });
    std::vector<std::unique_ptr<answer<>>> all;
    const cles::json_text body{"{\"x\":\"" + std::string(300, 'y') + "\"}"};
    for (int round = 0; round < 5; ++round) {
        for (int i = 0; i < 50; ++i) {
            all.push_back(std::make_unique<answer<>>());
            tower.async_push("car1:echo", body, all.back()->take());
        }
        run_until(io, [&] { return std::all_of(all.begin(), all.end(), [](const auto& a) { return a->done(); }); });
    }
    BOOST_TEST(std::none_of(all.begin(), all.end(), [](const auto& a) { return a->code.failed(); }));
}

CLES_DATA_TEST_CASE(past_the_limit_of_links_the_next_is_refused_as_busy_and_closed, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind, {.links = 3})};
    std::vector<scripted_peer> peers;
    for (int i = 0; i < 3; ++i) {
        peers.emplace_back(io, car.endpoints().front());
        BOOST_TEST(peers.back().ask("PULL self:cles").starts_with("{\"node\""));
    }
    scripted_peer silent{io, car.endpoints().front()};
    const auto said = silent.rest();
    BOOST_TEST(said.starts_with(R"({"error":"busy","message":)"), said);
    BOOST_TEST(said.find("\"retry_ms\":") != std::string::npos, said);
    scripted_peer eager{io, car.endpoints().front()};
    eager.send("PULL self:cles\n");
    BOOST_TEST(eager.rest().starts_with(R"({"error":"busy","message":)"));

    BOOST_TEST(peers.front().ask("PULL self:cles").starts_with("{\"node\"")); // existing links stay open
    peers.front().close();
    run_until(io, [&] {
        scripted_peer next{io, car.endpoints().front()};
        next.send("PULL self:cles\n");
        return next.line().starts_with("{\"node\"");
    });
}

BOOST_AUTO_TEST_CASE(past_the_limit_of_requests_in_flight_the_next_is_busy) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4, {.in_flight = 2})};
    std::vector<cles::responder> kept;
    car.on_delegate("drive", [&](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
    scripted_peer peer{io, car.endpoints().front()};
    peer.send("DELEGATE self:drive id=1\nDELEGATE self:drive id=2\nDELEGATE self:drive id=3\n");
    const auto refused = peer.line();
    BOOST_TEST(refused.starts_with(R"(id=3 {"error":"busy")"), refused);
    BOOST_TEST(refused.find("retry_ms") != std::string::npos, refused);
    kept.at(0).done();
    BOOST_TEST(peer.line() == "id=1 {}");
    peer.send("DELEGATE self:drive id=4\n");
    run_until(io, [&] { return kept.size() == 3; });
}

BOOST_AUTO_TEST_CASE(past_the_limits_of_handlers_bindings_and_nouns_the_next_is_busy) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4, {.bindings = 2, .nouns = 2, .running = 1})};
    std::vector<cles::responder> kept;
    car.on_delegate("drive", [&](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
    car.on_bind("place");
    scripted_peer peer{io, car.endpoints().front()};
    BOOST_TEST(peer.ask("BIND self:place/1") == "{}");
    BOOST_TEST(peer.ask("BIND self:place/2") == "{}");
    BOOST_TEST(peer.ask("BIND self:place/1 keep=3") == "{}"); // replaces
    BOOST_TEST(peer.ask("BIND self:place/3").starts_with(R"({"error":"busy")"));
    BOOST_TEST(peer.ask("BIND self:place/2 lease=0") == "{}");
    BOOST_TEST(peer.ask("BIND self:place/3") == "{}");
    BOOST_CHECK_EXCEPTION(car.update("place/5", 1), cles::error,
                          [](const cles::error& e) { return e.code() == errc::busy; });
    peer.send("DELEGATE self:drive id=1\n");
    BOOST_TEST(peer.ask("DELEGATE self:drive id=2").starts_with(R"(id=2 {"error":"busy")"));
    kept.clear();
    BOOST_TEST(peer.line().starts_with(R"(id=1 {"error":"failed")"));
    peer.send("DELEGATE self:drive id=3\n");
    run_until(io, [&] { return kept.size() == 1; });
}

// A link that floods must not keep the node from serving others.
CLES_DATA_TEST_CASE(a_flood_on_one_link_leaves_others_their_turn, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind)};
    int flooded = 0;
    car.on_push("flood", [&] { ++flooded; });
    car.on_pull("speed", [] { return 42; });
    scripted_peer flood{io, car.endpoints().front()};
    std::string text;
    for (int i = 0; i < 100'000; ++i) {
        text += "PUSH self:flood reply=no\n";
    }
    std::string_view left = text;
    scripted_peer polite{io, car.endpoints().front()};
    polite.send("PULL self:speed\n");
    run_until(io, [&] {
        left.remove_prefix(flood.send_some(left));
        return polite.ended() || !polite.unread().empty();
    });
    BOOST_TEST(flooded < 100'000);
    BOOST_TEST(polite.line() == R"({"value":42})");
}

BOOST_AUTO_TEST_SUITE_END()
