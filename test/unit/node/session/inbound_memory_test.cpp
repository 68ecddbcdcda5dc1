// SPDX-License-Identifier: BSL-1.0
// The memory that a node holds for its peers.
#include "support/recorded_reply.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace inbound_memory {
namespace {

using cles::verb;
using cles::test::test_link;

constexpr std::size_t enough_for_call = 1000; // more than is counted in addition to a request's text

struct fixture {
    explicit fixture(std::size_t memory = 1'000'000) : node(cles::limits{.memory = memory}) {
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on(verb::pull, "large", "[\"" + std::string(100'000, 'x') + "\"]");
        node.on(verb::push, "echo", "{}");
        node.on_later(verb::delegate, "work");
        node.open("map");
    }
    [[nodiscard]] std::size_t used() const { return node.host->memory.used(); }
    static std::string body(std::size_t bytes) { return "[\"" + std::string(bytes, 'x') + "\"]"; }

    cles::test::test_node node;
};

} // namespace
} // namespace inbound_memory

BOOST_FIXTURE_TEST_SUITE(inbound_memory, fixture)

BOOST_AUTO_TEST_CASE(a_running_request_counts_until_its_handler_releases_it) {
    test_link link{node};
    link.ask("DELEGATE car1:work id=1 " + body(50'000));
    BOOST_TEST(used() > 50'000U);
    BOOST_TEST(used() < 50'000U + enough_for_call);
    BOOST_TEST(link.account->used() == used());
    link.ask("PUSH self:cles/cancel/1"); // the handler still has its copy
    BOOST_TEST(used() > 50'000U);
    node.started.clear();
    link.settle();
    BOOST_TEST(used() == 0U);
}

BOOST_AUTO_TEST_CASE(it_counts_even_when_its_link_is_gone) {
    auto link = std::make_unique<test_link>(node);
    link->ask("DELEGATE car1:work id=1 " + body(50'000));
    link->reset();
    link.reset();
    BOOST_TEST(used() > 50'000U);
    node.started.clear();
    BOOST_TEST(used() == 0U);
}

BOOST_AUTO_TEST_CASE(beyond_its_share_a_link_is_busy_and_others_are_not) {
    test_link link{node};
    test_link other{node};
    int taken = 0;
    while (link.kind("DELEGATE car1:work id=" + std::to_string(taken + 1) + " " + body(20'000)).empty()) {
        BOOST_REQUIRE(++taken < 100);
    }
    BOOST_TEST(taken >= 22);
    BOOST_TEST(taken <= 25); // half of a million
    const auto refused = link.reply("DELEGATE car1:work id=99 " + body(20'000));
    BOOST_TEST(refused.error == "busy");
    BOOST_TEST(refused.retry_ms.value_or(0) > 0U);
    BOOST_TEST(!refused.ran);
    BOOST_TEST(other.kind("DELEGATE car1:work id=1 " + body(20'000)).empty());
    BOOST_TEST(other.kind("PULL car1:large") == "ok");
    BOOST_TEST(link.kind("PULL car1:speed") == "busy");
    // Requests about the node itself are answered, and running requests can be cancelled.
    BOOST_TEST(link.kind("PULL self:cles") == "ok");
    BOOST_TEST(link.kind("PULL self:cles/metrics") == "ok");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/1") == "id=1 cancelled, ok");
    node.started.erase(node.started.begin());
    link.settle();
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
    BOOST_TEST(link.kind("DELEGATE car1:work id=98 " + body(10'000)).empty());
}

BOOST_AUTO_TEST_CASE(waiting_requests_count) {
    test_link link{node};
    link.ask("DELEGATE car1:work");
    const auto before = used();
    for (int i = 0; i < 3; ++i) {
        link.ask("PUSH car1:echo " + body(100'000));
    }
    BOOST_TEST(used() >= before + 300'000U);
    link.ask("PUSH car1:echo " + body(450'000)); // too much
    link.ask("PULL self:cles");
    node.started.at(0)->call->done("{}");
    node.started.clear();
    BOOST_TEST(link.sent() == "ok, ok, ok, ok, busy, ok");
    link.settle();
    BOOST_TEST(used() == 0U);
}

BOOST_AUTO_TEST_CASE(unread_replies_count_and_beyond_the_share_say_that_they_ran) {
    test_link link{node};
    std::vector<std::string> kinds;
    for (int i = 0; i < 20; ++i) {
        link.session().on_line("DELEGATE car1:work id=" + std::to_string(i + 1), node.clock.now());
    }
    for (const auto& each : node.started) {
        each->call->done(body(100'000));
        BOOST_TEST(used() <= 1'000'000U);
    }
    node.started.clear();
    link.settle();
    BOOST_TEST(used() == link.unsent());
    BOOST_TEST(used() > 300'000U);
    int full = 0;
    int refused = 0;
    for (const auto& line : link.take_lines()) {
        const auto reply = cles::test::read_reply(line);
        full += reply.error.empty() ? 1 : 0;
        refused += reply.error == "busy" && reply.ran ? 1 : 0;
    }
    BOOST_TEST(full + refused == 20);
    BOOST_TEST(full >= 4);
    BOOST_TEST(used() == 0U);
}

BOOST_AUTO_TEST_CASE(a_bind_without_memory_for_its_reply_does_not_bind) {
    node.publish_now("map", body(100'000));
    test_link link{node};
    for (int i = 0; i < 4; ++i) {
        link.session().on_line("PULL car1:large", node.clock.now());
    }
    link.settle();
    link.session().on_line("BIND car1:map id=1", node.clock.now());
    const auto lines = link.take_lines();
    BOOST_TEST(cles::test::read_reply(lines.back()).error == "busy");
    BOOST_TEST(!cles::test::read_reply(lines.back()).ran);
    BOOST_TEST(link.session().serving().bindings() == 0U);
    BOOST_TEST(link.kind("BIND car1:map id=2") == "id=2 ok");
    BOOST_TEST(link.session().serving().bindings() == 1U);
}

BOOST_AUTO_TEST_CASE(unsent_requests_are_busy_beyond_the_share) {
    test_link link{node};
    std::vector<std::shared_ptr<cles::test::outcome>> outcomes;
    const auto large = body(100'000);
    for (std::uint64_t id = 1; id <= 20; ++id) {
        auto [operation, result] = cles::test::record();
        link.session().asking().send({.verb = verb::push, .noun = "car2:echo", .id = id, .body = large},
                                     node.clock.now() + std::chrono::seconds{5}, node.clock.now(),
                                     std::move(operation));
        outcomes.push_back(result);
        BOOST_TEST(used() <= 600'000U);
    }
    node.pass(std::chrono::milliseconds{0});
    int refused = 0;
    for (const auto& each : outcomes) {
        refused += each->ended && each->code == cles::errc::busy ? 1 : 0;
    }
    BOOST_TEST(refused >= 14);
    BOOST_TEST(refused <= 16);
    BOOST_TEST(link.session().asking().in_flight() == 20U - static_cast<std::size_t>(refused));
    auto [operation, result] = cles::test::record();
    link.session().asking().send({.verb = verb::pull, .noun = "car2:cles/peers", .id = 99, .body = large},
                                 node.clock.now() + std::chrono::seconds{5}, node.clock.now(), std::move(operation));
    node.pass(std::chrono::milliseconds{0});
    BOOST_TEST(!result->ended); // the reserved task keeps the network together
}

// However they end, no call is kept for them.
BOOST_AUTO_TEST_CASE(decided_bindings_no_longer_count) {
    node.on_later(verb::bind, "lane");
    node.on_later(verb::bind, "road");
    test_link link{node};
    const auto is_idle = [&] {
        node.started.clear();
        static_cast<void>(link.take());
        link.settle();
        return used() == 0;
    };
    for (const auto* noun : {"lane", "road"}) {
        const std::string bind = "BIND car1:" + std::string{noun} + "/a id=7 deadline=100";
        link.ask(bind);
        BOOST_TEST(used() != 0U);
        node.started.at(0)->call->done("{}");
        BOOST_TEST(is_idle());
        link.ask(bind);
        node.started.at(0)->call->fail({.code = cles::errc::denied, .message = "not you"});
        BOOST_TEST(is_idle());
        link.ask(bind);
        node.pass(std::chrono::milliseconds{100});
        BOOST_TEST(is_idle());
        link.ask(bind);
        link.ask("PUSH self:cles/cancel/7 reply=no");
        BOOST_TEST(is_idle());
        link.ask(bind);
        link.ask("BIND car1:" + std::string{noun} + "/a lease=0");
        BOOST_TEST(is_idle());
    }
}

// At every step, the sum of what all parts hold is what the node reports; nothing is left at the end.
BOOST_AUTO_TEST_CASE(all_parts_add_up) {
    auto a = std::make_unique<test_link>(node);
    auto b = std::make_unique<test_link>(node);
    const auto adds_up = [&] {
        a->settle();
        b->settle();
        BOOST_TEST(a->account->used() + b->account->used() + node.host->kept_values->used() +
                       node.host->kept_requests->used() ==
                   used());
    };
    std::size_t calls = 0;
    const auto line = [&](test_link& to, const std::string& text) {
        to.session().on_line(text, node.clock.now());
        adds_up();
    };
    line(*a, "BIND car1:map/1");
    line(*b, "BIND car1:map/1 every=1000");
    a->takes = false;
    for (int i = 0; i < 5; ++i) {
        node.publish_now("map/" + std::to_string(i), body(10'000));
        node.publish_now("map/1", body(5'000));
        adds_up();
        line(*a, "DELEGATE car1:work id=" + std::to_string(i + 1) + " " + body(1'000));
        line(*b, "DELEGATE car1:work " + body(1'000)); // they run one after another
        line(*b, "PULL car1:large");
        line(*a, "PULL car1:large id=" + std::to_string(i + 100));
        ++calls;
    }
    const auto values = node.host->kept_values->used();
    BOOST_TEST(values > 4U * 10'000U + 5U * 5'000U);
    BOOST_TEST(values < 2U * (5U * 10'000U + 6U * 5'000U));
    BOOST_TEST(a->account->used() >= a->unsent() + 5U * 1'000U);
    while (!node.started.empty()) {
        const auto next = node.started.front();
        node.started.erase(node.started.begin());
        next->call->done(body(2'000));
        adds_up();
        while (b->session().serving().has_more()) { // until the next one starts
            b->turn();
            adds_up();
        }
    }
    a->make_writable();
    adds_up();
    node.pass(std::chrono::milliseconds{1000});
    adds_up();
    static_cast<void>(a->take());
    static_cast<void>(b->take());
    a->half_close();
    b->reset();
    static_cast<void>(a->take());
    a.reset();
    b.reset();
    BOOST_TEST(node.host->kept_values->used() == used());
    for (int i = 0; i < 5; ++i) {
        node.host->published.retire("map/" + std::to_string(i));
    }
    BOOST_TEST(used() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
