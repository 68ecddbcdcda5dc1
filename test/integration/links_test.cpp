// SPDX-License-Identifier: BSL-1.0
// Which links a node keeps: peers that vanish, that are silent, and that connect when the limit is reached.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/metric.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <malloc.h>

BOOST_AUTO_TEST_SUITE(links)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;

constexpr std::array tcp_and_unix{carrier::tcp4, carrier::unix_abstract};

struct node {
    explicit node(carrier kind = carrier::tcp4, const cles::limits& bounds = {})
        : car(io, listening("car1", kind, bounds)) {
        car.on_pull("speed", [] { return 42; });
        car.on_push("echo", [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; });
        car.on_delegate("drive", [this](const cles::request&, cles::responder r) { jobs.push_back(std::move(r)); });
        car.on_bind("notice");
    }
    scripted_peer peer() { return {io, car.endpoints().front()}; }
    std::uint64_t metric(const std::string& name) { return cles::test::metric(car, name); }
    /// Links that others opened, as far as this counter shows: the node's own link to itself is one.
    std::uint64_t open() { return metric("links_open") - own; }

    asio::io_context io;
    std::vector<cles::responder> jobs;
    cles::service car;
    std::uint64_t own = 0;
};

bool is_busy(const std::string& line) { return line.starts_with(R"({"error":"busy","message":")"); }

// -- peers that vanish ---------------------------------------------------------------------------------------------

// The system still accepts such a connection, but can no longer tell the peer's address.
CLES_DATA_TEST_CASE(a_peer_that_disconnects_before_it_is_accepted_is_harmless, tcp_and_unix, kind) {
    node n{kind};
    n.own = n.metric("links_open");
    for (int i = 0; i < 20; ++i) {
        auto gone = n.peer();
        gone.send("PULL self:sp");
        gone.reset();
    }
    BOOST_TEST(n.peer().ask("PULL self:speed") == R"({"value":42})");
    run_until(n.io, [&] { return n.open() == 0; });
}

CLES_DATA_TEST_CASE(links_that_close_free_capacity_and_end_their_bindings, tcp_and_unix, kind) {
    node n{kind, {.nouns = 50, .probe = 20ms}};
    n.own = n.metric("links_open");
    for (int i = 0; i < 1100; ++i) {
        auto peer = n.peer();
        BOOST_REQUIRE_EQUAL(peer.ask("BIND self:notice"), "{}");
    }
    run_until(n.io, [&] { return n.open() == 0; });
    // Each bound a different noun, and none remains bound.
    for (int round = 0; round < 2; ++round) {
        std::vector<scripted_peer> peers;
        for (int i = 0; i < 49; ++i) {
            peers.push_back(n.peer());
            BOOST_REQUIRE_EQUAL(peers.back().ask("BIND self:notice/" + std::to_string(round * 100 + i)), "{}");
        }
        peers.clear();
        run_until(n.io, [&] { return n.open() == 0; });
    }
}

BOOST_AUTO_TEST_CASE(a_half_closed_subscriber_that_reads_is_probed_with_empty_lines_and_stays_bound) {
    node n{carrier::tcp4, {.probe = 10ms}};
    auto peer = n.peer();
    BOOST_TEST(peer.ask("BIND self:notice") == "{}");
    peer.shut();
    BOOST_TEST(peer.line().empty());
    BOOST_TEST(peer.line().empty());
    n.car.update("notice", 1);
    std::string line;
    while (line.empty()) {
        line = peer.line();
    }
    BOOST_TEST(line.starts_with("UPDATE car1:notice seq=1 epoch="), line);
    BOOST_TEST(!peer.ended());
}

BOOST_AUTO_TEST_CASE(a_peer_that_waits_for_a_reply_is_probed_too) {
    node n{carrier::tcp4, {.probe = 20ms}};
    {
        auto gone = n.peer();
        gone.send("DELEGATE self:drive deadline=3600000\n");
        gone.shut();
        run_until(n.io, [&] { return n.jobs.size() == 1; });
    }
    run_until(n.io, [&] { return n.jobs.front().stopped(); });

    auto waits = n.peer();
    waits.send("DELEGATE self:drive\n");
    waits.shut();
    run_until(n.io, [&] { return n.jobs.size() == 2; });
    BOOST_TEST(waits.line().empty());
    n.jobs.back().done();
    const auto rest = waits.rest();
    BOOST_TEST(rest.ends_with("{}\n"), rest);
    BOOST_TEST(!waits.was_reset());
}

BOOST_AUTO_TEST_CASE(a_unix_peer_that_hangs_up_is_noticed_without_a_probe) {
    node n{carrier::unix_abstract};
    {
        auto gone = n.peer();
        gone.send("BIND self:notice\nDELEGATE self:drive\n");
        BOOST_TEST(gone.line() == "{}");
        gone.shut();
        run_until(n.io, [&] { return n.jobs.size() == 1; });
        run_ready(n.io);
        BOOST_TEST(!n.jobs.front().stopped());
    }
    run_until(
        n.io, [&] { return n.jobs.front().stopped(); }, 3s);
}

CLES_DATA_TEST_CASE(at_the_limit_the_oldest_half_closed_link_is_evicted, tcp_and_unix, kind) {
    node n{kind, {.links = 3}};
    std::vector<scripted_peer> peers;
    for (int i = 0; i < 3; ++i) {
        peers.push_back(n.peer());
        BOOST_TEST(peers.back().ask("BIND self:notice") == "{}");
        if (i != 1) {
            peers.back().shut();
            run_ready(n.io);
        }
    }
    auto next = n.peer();
    BOOST_TEST(next.ask("PULL self:speed") == R"({"value":42})");
    BOOST_TEST(peers[0].rest().empty());
    n.car.update("notice", 1);
    BOOST_TEST(peers[1].line().starts_with("UPDATE "));
    BOOST_TEST(peers[2].line().starts_with("UPDATE "));
    BOOST_TEST(n.metric("links_evicted") == 1U);
}

// -- silent peers --------------------------------------------------------------------------------------------------

CLES_DATA_TEST_CASE(a_link_that_brings_no_whole_line_in_time_is_closed, tcp_and_unix, kind) {
    node n{kind, {.links = 3, .first_line = 50ms}};
    auto silent = n.peer();
    auto drips = n.peer();
    auto talks = n.peer();
    BOOST_TEST(talks.ask("PULL self:speed") == R"({"value":42})");
    run_until(n.io, [&] {
        if (!drips.ended()) {
            drips.send_some("x");
        }
        return silent.ended() && drips.ended();
    });
    auto next = n.peer();
    BOOST_TEST(next.ask("PULL self:speed") == R"({"value":42})");
    BOOST_TEST(talks.ask("PULL self:speed") == R"({"value":42})"); // may be silent from then on
}

BOOST_AUTO_TEST_CASE(silent_links_are_evicted_for_new_ones_and_receive_the_reason) {
    node n{carrier::tcp4, {.links = 3}};
    std::vector<scripted_peer> silent;
    for (int i = 0; i < 3; ++i) {
        silent.push_back(n.peer());
    }
    run_until(n.io, [&] { // once they have had a second
        auto next = n.peer();
        next.send("PULL self:speed\n");
        return next.line() == R"({"value":42})";
    });
    BOOST_TEST(is_busy(silent[0].rest()));
    BOOST_TEST(!silent[0].was_reset());
}

BOOST_AUTO_TEST_CASE(an_address_beyond_its_share_gives_way_to_another) {
    node n{carrier::tcp4, {.links = 4}};
    const auto where = cles::parse_url(n.car.endpoints().front());
    std::vector<scripted_peer> greedy;
    for (int i = 0; i < 4; ++i) {
        greedy.push_back(n.peer());
        BOOST_TEST(greedy.back().ask("BIND self:notice") == "{}");
    }
    auto more = n.peer();
    BOOST_TEST(is_busy(more.rest()));
    asio::ip::tcp::socket other{n.io, {asio::ip::make_address("127.0.0.2"), 0}};
    other.connect({asio::ip::make_address(where.host), where.port});
    asio::write(other, asio::buffer(std::string{"PULL self:speed\n"}));
    std::string said;
    asio::async_read_until(other, asio::dynamic_buffer(said), '\n', [](boost::system::error_code, std::size_t) {});
    run_until(n.io, [&] { return said.ends_with('\n'); });
    BOOST_TEST(said == "{\"value\":42}\n");
    BOOST_TEST(greedy[3].rest().empty()); // the last to connect
    n.car.update("notice", 1);
    for (int i = 0; i < 3; ++i) {
        BOOST_TEST(greedy[static_cast<std::size_t>(i)].line().starts_with("UPDATE "));
    }
}

// -- nodes at their limit ------------------------------------------------------------------------------------------

CLES_DATA_TEST_CASE(a_refused_peer_receives_the_line_independently_of_its_input, tcp_and_unix, kind) {
    node n{kind, {.links = 1}};
    auto inside = n.peer();
    BOOST_TEST(inside.ask("BIND self:notice") == "{}");
    for (int i = 0; i < 20; ++i) {
        auto eager = n.peer();
        eager.send_some("PUSH self:echo {\"x\":\"" + std::string(100'000, 'x')); // unread, it would make for a reset
        const auto said = eager.rest();
        BOOST_TEST(is_busy(said), said);
        BOOST_TEST(!eager.was_reset());
    }
}

CLES_DATA_TEST_CASE(a_request_to_a_node_at_its_limit_of_links_is_busy, tcp_and_unix, kind) {
    node n{kind, {.links = 1}};
    auto inside = n.peer();
    BOOST_TEST(inside.ask("BIND self:notice") == "{}");
    asio::io_context there; // reached only by a socket
    cles::service tower{there, knowing("tower", n.car)};
    const auto until = [&](auto&& holds) {
        run_until(n.io, [&] {
            there.restart();
            there.poll();
            return holds();
        });
    };
    for (int i = 0; i < 3; ++i) {
        answer<> pulled;
        tower.async_pull("car1:speed", pulled.options(), pulled.take());
        answer<> pushed;
        tower.async_push("car1:echo", cles::json_text{"[1]"}, pushed.options(), pushed.take());
        until([&] { return pulled.done() && pushed.done(); });
        for (const auto& each : {pulled, pushed}) {
            BOOST_TEST((each.code == errc::busy), each.code.message());
            BOOST_TEST(each.words == "car1 has reached its limit of links");
        }
    }
    inside.close();
    boost::system::error_code last = errc::busy;
    while (last == errc::busy) { // until the node has noticed
        answer<> pulled;
        tower.async_pull("car1:speed", pulled.take());
        until([&] { return pulled.done(); });
        last = pulled.code;
    }
    BOOST_TEST(!last, last.message());
}

// -- memory --------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(idle_links_give_back_what_large_messages_took) {
    node n;
    const auto in_use = [] {
        const auto now = ::mallinfo2();
        return now.uordblks + now.hblkhd;
    };
    const auto where = cles::parse_url(n.car.endpoints().front());
    std::vector<asio::ip::tcp::socket> peers;
    const auto ask = [&](asio::ip::tcp::socket& peer, const std::string& line) {
        asio::async_write(peer, asio::buffer(line), [](boost::system::error_code, std::size_t) {});
        std::string said;
        asio::async_read_until(peer, asio::dynamic_buffer(said), '\n', [](boost::system::error_code, std::size_t) {});
        run_until(n.io, [&] { return said.ends_with('\n'); });
        return said.size();
    };
    for (int i = 0; i < 12; ++i) {
        peers.emplace_back(n.io).connect({asio::ip::make_address(where.host), where.port});
        ask(peers.back(), "PULL self:speed\n");
    }
    const auto large = "PUSH self:echo {\"x\":\"" + std::string(1'000'000, 'x') + "\"}\n";
    const auto before = in_use();
    for (auto& peer : peers) {
        BOOST_REQUIRE(ask(peer, large) > 1'000'000U);
    }
    const auto least = before + peers.size() * 10'000;
    run_until(n.io, [&] { return in_use() < least; });
    BOOST_TEST(ask(peers.front(), large) > 1'000'000U);
}

BOOST_AUTO_TEST_SUITE_END()
