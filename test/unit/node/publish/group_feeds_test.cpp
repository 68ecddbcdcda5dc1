// SPDX-License-Identifier: BSL-1.0
// The subscriber's side of docs/protocol.md, "Multicast".
#include "node/publish/group_feeds.hpp"
#include "node/publish/multicast_group.hpp"
#include "support/group_recorder.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace group_feeds {
namespace {

using namespace std::chrono_literals;
using namespace cles::test;
using cles::core::group_feed;

/// One wait for an event; it lives on the stack of its test.
struct wait final : cles::detail::pending_event {
    bool deliver(const cles::detail::raw_event& event) override {
        text = event.kind == cles::feed_event::gap ? "gap of " + std::to_string(event.missed)
                                                   : std::to_string(event.seq) + " " + std::string{event.body};
        text = std::string{event.publisher} + " " + text;
        return true;
    }
    void fail(boost::system::error_code code, std::string_view) override { text = code.message(); }
    void discard() noexcept override {}
    std::string text;
};

struct fixture {
    fixture() { group.add(out); }
    /// Receives an update; returns whether a feed accepted it.
    bool hear(const std::string& line) {
        cles::protocol::request_line r;
        cles::protocol::malformed_request why;
        BOOST_REQUIRE(cles::protocol::parse_request(line, r, why));
        return feeds.take(r);
    }
    bool hear(const std::string& publisher, std::uint64_t seq, const std::string& epoch = "00000001") {
        return hear("UPDATE " + publisher + ":speed seq=" + std::to_string(seq) + " epoch=" + epoch + " {}");
    }
    /// The events of a feed, as "car1 1 {}", "car1 gap of 2".
    static std::vector<std::string> events(group_feed& feed) {
        std::vector<std::string> all;
        for (;;) {
            wait w;
            if (!feed.mail().next(cles::core::feed_mailbox::event_ptr{&w})) {
                feed.mail().cancel();
                return all;
            }
            feed.mail().pump();
            all.push_back(w.text);
        }
    }
    void add(group_feed& feed) { feeds.add(feed, node.clock.now()); }

    test_node node;
    group_recorder out;
    cles::core::multicast_group group{node.host, 3};
    cles::core::group_feeds& feeds = group.feeds();
    group_feed all{node.host->bounds, node.host->completions, "all", "speed"};
    group_feed one{node.host->bounds, node.host->completions, "car1", "speed"};
};

using lines = std::vector<std::string>;

} // namespace
} // namespace group_feeds

BOOST_FIXTURE_TEST_SUITE(group_feeds, fixture)

BOOST_AUTO_TEST_CASE(restarted_nodes_are_bound_again_soon_with_one_bind) {
    add(all);
    add(one);
    out.take();
    feeds.rebind_soon("car2", node.clock.now());
    feeds.rebind_soon("car3", node.clock.now());
    node.pass(50ms);
    BOOST_TEST((out.take() == lines{"BIND all:speed lease=10000"}));
    feeds.rebind_soon("car1", node.clock.now());
    node.pass(50ms);
    BOOST_TEST(out.take().size() == 2U);
}

BOOST_AUTO_TEST_CASE(the_first_feed_of_a_noun_binds_and_the_last_unbinds) {
    group_feed second{node.host->bounds, node.host->completions, "all", "speed"};
    add(all);
    add(second);
    BOOST_TEST((out.take() == lines{"BIND all:speed lease=10000"}));
    feeds.remove(all);
    BOOST_TEST(out.take().empty());
    feeds.remove(second);
    BOOST_TEST((out.take() == lines{"BIND all:speed lease=0"}));
    feeds.remove(second);
    BOOST_TEST(out.take().empty());
    node.pass(60s);
    BOOST_TEST(out.take().empty());
}

BOOST_AUTO_TEST_CASE(a_binding_is_renewed_at_a_third_of_its_lease_with_jitter) {
    add(all);
    out.take();
    std::vector<std::chrono::milliseconds> pauses;
    auto pause = 0ms;
    while (pauses.size() < 20) {
        node.pass(1ms);
        pause += 1ms;
        if (const auto sent = out.take(); !sent.empty()) {
            BOOST_TEST((sent == lines{"BIND all:speed lease=10000"}));
            pauses.push_back(pause);
            pause = 0ms;
        }
        BOOST_REQUIRE(pause.count() <= 3333);
    }
    const auto [least, most] = std::minmax_element(pauses.begin(), pauses.end());
    BOOST_TEST(least->count() >= 2500 - 1);
    BOOST_TEST((*most - *least).count() > 100);
    feeds.remove(all);
}

BOOST_AUTO_TEST_CASE(an_update_goes_to_every_feed_that_wants_it) {
    group_feed other{node.host->bounds, node.host->completions, "car2", "speed"};
    group_feed elsewhere{node.host->bounds, node.host->completions, "all", "speed/fast"};
    for (auto* feed : {&all, &one, &other, &elsewhere}) {
        add(*feed);
    }
    BOOST_TEST(hear("car1", 1));
    BOOST_TEST((events(all) == lines{"car1 1 {}"}));
    BOOST_TEST((events(one) == lines{"car1 1 {}"}));
    BOOST_TEST(events(other).empty());
    BOOST_TEST(events(elsewhere).empty());
    BOOST_TEST(!hear("UPDATE car1:slowness seq=1 epoch=00000001 {}"));
    static_cast<void>(feeds.remove_all());
}

BOOST_AUTO_TEST_CASE(closing_a_feed_of_one_node_keeps_the_lease_for_a_feed_of_all) {
    add(all);
    add(one);
    out.take();
    feeds.remove(one);
    BOOST_TEST(out.take().empty());
    feeds.remove(all);
    BOOST_TEST((out.take() == lines{"BIND all:speed lease=0"}));
}

BOOST_AUTO_TEST_CASE(closing_a_feed_of_all_binds_feeds_of_single_nodes_again) {
    add(all);
    add(one);
    out.take();
    feeds.remove(all);
    BOOST_TEST((out.take() == lines{"BIND all:speed lease=0", "BIND car1:speed lease=10000"}));
    feeds.remove(one);
    BOOST_TEST((out.take() == lines{"BIND car1:speed lease=0"}));
}

BOOST_AUTO_TEST_CASE(feeds_may_be_closed_and_added_during_delivery) {
    group_feed last{node.host->bounds, node.host->completions, "all", "speed"};
    group_feed late{node.host->bounds, node.host->completions, "all", "speed"};
    struct meddler final : cles::detail::pending_event {
        bool deliver(const cles::detail::raw_event&) override {
            f->feeds.remove(f->all);
            f->feeds.remove(f->one);
            f->add(*fresh);
            return true;
        }
        void fail(boost::system::error_code, std::string_view) override {}
        void discard() noexcept override {}
        fixture* f = nullptr;
        group_feed* fresh = nullptr;
    } meddling;
    meddling.f = this;
    meddling.fresh = &late;
    for (auto* feed : {&all, &one, &last}) {
        add(*feed);
    }
    BOOST_TEST(!all.mail().next(cles::core::feed_mailbox::event_ptr{&meddling}));
    BOOST_TEST(hear("car1", 1));
    BOOST_TEST(events(one).empty());
    BOOST_TEST((events(last) == lines{"car1 1 {}"}));
    BOOST_TEST(events(late).empty());
    BOOST_TEST(hear("car1", 2));
    BOOST_TEST((events(late) == lines{"car1 2 {}"}));
    BOOST_TEST((feeds.remove_all() == std::vector<group_feed*>{&last, &late}));
    BOOST_TEST(!hear("car1", 3));
}

BOOST_AUTO_TEST_CASE(a_feed_closed_during_delivery_leaves_nothing_behind) {
    group_feed elsewhere{node.host->bounds, node.host->completions, "all", "speed/fast"};
    struct meddler final : cles::detail::pending_event {
        bool deliver(const cles::detail::raw_event&) override {
            for (auto* feed : ends) {
                f->feeds.remove(*feed);
            }
            throw std::runtime_error{"of the user's"};
        }
        void fail(boost::system::error_code, std::string_view) override {}
        void discard() noexcept override {}
        fixture* f = nullptr;
        std::vector<group_feed*> ends;
    } meddling;
    meddling.f = this;
    meddling.ends = {&elsewhere, &all};
    add(all);
    add(elsewhere);
    BOOST_TEST(!all.mail().next(cles::core::feed_mailbox::event_ptr{&meddling}));
    hear("car1", 1);
    BOOST_TEST(feeds.empty());
}

BOOST_AUTO_TEST_SUITE_END()
