// SPDX-License-Identifier: BSL-1.0
#include "node/publish/feed_machine.hpp"
#include "support/manual_clock.hpp"
#include "support/recorded_reply.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <string_view>

namespace feed_machine {
namespace {

using cles::errc;
using cles::feed_event;
using namespace std::chrono_literals;
using event_ptr = cles::core::feed_machine::event_ptr;

class counting_host final : public cles::core::feed_host {
  public:
    void bind(cles::core::feed_machine&) override { ++binds; }
    void unbind(cles::core::feed_machine&) override { ++unbinds; }
    void detach(cles::core::feed_machine&) override { ++detaches; }
    void renew(cles::core::feed_machine&, cles::time_point until) override {
        ++renewals;
        renew_until = until;
    }
    int detaches = 0;
    int renewals = 0;
    cles::time_point renew_until{};
    int binds = 0;
    int unbinds = 0;
};

/// One wait for an event. It lives on the stack of its test, so nothing deletes it.
class wait final : public cles::detail::pending_event {
  public:
    bool deliver(const cles::detail::raw_event& event) override {
        if (!event.has_json()) {
            return false;
        }
        switch (event.kind) {
        case feed_event::current: text = "current " + std::string{event.body}; break;
        case feed_event::update: text = "update " + std::to_string(event.seq) + " " + std::string{event.body}; break;
        case feed_event::gap: text = "gap " + std::to_string(event.missed); break;
        case feed_event::lost: text = "lost " + std::string{event.text}; break;
        case feed_event::rebound: text = "rebound"; break;
        }
        return true;
    }
    void fail(boost::system::error_code code, std::string_view) override { text = "failed: " + code.message(); }
    void discard() noexcept override {}
    std::string text = "(waiting)";
};

const cles::update_mark seventh{.seq = 7, .epoch = 0x5f3a09c1};

struct fixture {
    explicit fixture(cles::limits bounds = {.lease = 9s})
        : feed(host, deadlines, completions, bounds, "car1", "speed", false, 7) {}

    /// Binds for the first time; the publisher replies with `last`.
    void bound(std::string_view last = "{}") {
        first = begin();
        feed.on_bound(last);
    }
    std::shared_ptr<cles::test::outcome> begin(cles::time_point due = cles::time_point::max()) {
        auto [operation, result] = cles::test::record();
        feed.start(std::move(operation), due);
        return result;
    }
    void update(std::uint64_t seq, std::string_view epoch = "0000000a", std::string_view body = "{}") {
        const auto line =
            "UPDATE car1:speed seq=" + std::to_string(seq) + " epoch=" + std::string{epoch} + " " + std::string{body};
        cles::protocol::request_line update;
        cles::protocol::malformed_request error;
        BOOST_REQUIRE(cles::protocol::parse_request(line, update, error));
        feed.take(update);
    }
    /// The next event, or "(nothing)".
    std::string next() {
        wait w;
        if (!feed.mail().next(cles::core::feed_machine::event_ptr{&w})) {
            feed.mail().cancel();
            return "(nothing)";
        }
        feed.mail().pump();
        return w.text;
    }
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }
    void lose() { feed.on_lost("the link was lost", clock.now()); }

    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::completion_queue completions;
    counting_host host;
    cles::core::feed_machine feed;
    std::shared_ptr<cles::test::outcome> first;
};

} // namespace
} // namespace feed_machine

BOOST_FIXTURE_TEST_SUITE(feed_machine, fixture)

BOOST_AUTO_TEST_CASE(start_binds_and_the_reply_completes_it) {
    const auto result = begin();
    BOOST_TEST(host.binds == 1);
    BOOST_TEST(!result->ended);
    feed.on_bound("{}");
    BOOST_TEST(result->ended);
    BOOST_TEST(!result->code);
    BOOST_TEST(next() == "(nothing)"); // there was no last value
}

// It may wait for a link, for what the node supports, or for the reply: each takes the peer's time.
BOOST_AUTO_TEST_CASE(the_first_bind_ends_at_its_deadline) {
    const auto result = begin(clock.now() + 5s);
    pass(4999ms);
    BOOST_TEST(!result->ended);
    pass(1ms);
    BOOST_TEST(result->ended);
    BOOST_TEST((result->code == cles::errc::deadline));
    BOOST_TEST(host.unbinds == 1);
    BOOST_TEST(feed.closed());
}

BOOST_AUTO_TEST_CASE(a_feed_that_is_bound_has_no_deadline) {
    const auto result = begin(clock.now() + 5s);
    feed.on_bound("{}");
    pass(1h);
    BOOST_TEST(!result->code);
    BOOST_TEST(feed.is_bound());
}

BOOST_AUTO_TEST_CASE(the_last_value_comes_as_the_first_event) {
    bound("{\"v\":3}");
    BOOST_TEST(first->text == "{\"v\":3}");
    update(5);
    BOOST_TEST(next() == "current {\"v\":3}");
    BOOST_TEST(next() == "update 5 {}");
}

// Each has a mailbox of its own.
BOOST_AUTO_TEST_CASE(an_overflow_does_not_affect_feeds_that_share_the_binding) {
    cles::core::feed_machine full{host, deadlines, completions, cles::limits{.feed = 2}, "car1", "speed", false, 7};
    cles::core::subscriptions both;
    for (auto* each : {&feed, &full}) {
        auto [operation, result] = cles::test::record();
        each->set_sharing_key("every=0");
        BOOST_TEST(both.add(*each));
        each->start(std::move(operation));
        each->on_bound("{}");
    }
    for (int seq = 1; seq <= 4; ++seq) {
        const auto line = "UPDATE car1:speed seq=" + std::to_string(seq) + " epoch=0000000a {}";
        cles::protocol::request_line update;
        cles::protocol::malformed_request error;
        BOOST_REQUIRE(cles::protocol::parse_request(line, update, error));
        BOOST_TEST(both.deliver(both.find(line, update)));
        BOOST_TEST(next() == "update " + std::to_string(seq) + " {}");
    }
    const auto next_of_full = [&full] {
        wait w;
        BOOST_TEST(full.mail().next(event_ptr{&w}));
        full.mail().pump();
        return w.text;
    };
    BOOST_TEST(next_of_full() == "gap 2");
    BOOST_TEST(next_of_full() == "update 3 {}");
    both.remove(full);
    full.close(cles::errc::cancelled);
    both.remove(feed);
}

BOOST_AUTO_TEST_CASE(a_marked_value_is_delivered_as_an_update_if_it_is_new) {
    bound();
    update(seventh.seq, "5f3a09c1", "{\"v\":2}");
    BOOST_TEST(next() == "update 7 {\"v\":2}");
    const auto bind_again = [this](std::string_view last, const cles::update_mark& mark) {
        lose();
        BOOST_TEST(next().starts_with("lost"));
        pass(1min);
        feed.on_bound(last, mark);
        BOOST_TEST(next() == "rebound");
    };
    bind_again("{\"v\":2}", seventh); // a repeat
    BOOST_TEST(next() == "current {\"v\":2}");
    bind_again("{\"v\":5}", {.seq = 10, .epoch = seventh.epoch});
    BOOST_TEST(next() == "gap 2");
    BOOST_TEST(next() == "update 10 {\"v\":5}");
    BOOST_TEST(next() == "current {\"v\":5}");
    bind_again("{\"v\":1}", {.seq = 1, .epoch = 0xbeef}); // another incarnation
    BOOST_TEST(next() == "update 1 {\"v\":1}");
    BOOST_TEST(next() == "current {\"v\":1}");
    update(1, "0000beef");  // a repeat
    update(11, "5f3a09c1"); // of the previous incarnation
    BOOST_TEST(next() == "(nothing)");
}

BOOST_AUTO_TEST_CASE(a_value_is_told_with_its_mark) {
    static_cast<void>(begin());
    feed.on_bound("{\"v\":2}", {}, seventh);
    struct marked_wait final : cles::detail::pending_event {
        bool deliver(const cles::detail::raw_event& event) override {
            kind = event.kind;
            mark = {.seq = event.seq, .epoch = event.epoch};
            return true;
        }
        void fail(boost::system::error_code, std::string_view) override {}
        void discard() noexcept override {}
        feed_event kind = feed_event::lost;
        cles::update_mark mark{};
    } w;
    BOOST_REQUIRE(feed.mail().next(event_ptr{&w}));
    feed.mail().pump();
    BOOST_TEST((w.kind == feed_event::current));
    BOOST_TEST((w.mark == seventh));
    BOOST_TEST(!feed.mail().next(event_ptr{&w}));
    update(8, "5f3a09c1");
    BOOST_TEST((w.kind == feed_event::update));
    BOOST_TEST((w.mark == cles::update_mark{.seq = 8, .epoch = seventh.epoch}));
}

BOOST_AUTO_TEST_CASE(a_refusal_of_the_first_bind_closes_it) {
    const auto result = begin();
    feed.on_refused(errc::no_task, "car1 has no BIND 'speed'", clock.now());
    BOOST_TEST((result->code == errc::no_task));
    BOOST_TEST(result->text == "car1 has no BIND 'speed'");
    BOOST_TEST(feed.closed());
    pass(1h);
    BOOST_TEST(host.binds == 1);
}

BOOST_AUTO_TEST_CASE(an_event_goes_to_the_operation_that_waits) {
    bound();
    wait w;
    BOOST_TEST(!feed.mail().next(cles::core::feed_machine::event_ptr{&w}));
    BOOST_TEST(feed.mail().has_waiter());
    update(1);
    BOOST_TEST(w.text == "update 1 {}");
    BOOST_TEST(!feed.mail().has_waiter());
    BOOST_TEST(next() == "(nothing)");
}

BOOST_AUTO_TEST_CASE(a_gap_is_reported_before_the_update_that_shows_it) {
    bound();
    update(1);
    update(4);
    BOOST_TEST(next() == "update 1 {}");
    BOOST_TEST(next() == "gap 2");
    BOOST_TEST(next() == "update 4 {}");
}

BOOST_AUTO_TEST_CASE(a_lost_publisher_is_reported_and_bound_again_after_a_pause) {
    bound();
    lose();
    BOOST_TEST(next() == "lost the link was lost");
    BOOST_TEST(host.binds == 1);
    pass(74ms); // the first pause lasts from 75 to 100 ms
    BOOST_TEST(host.binds == 1);
    pass(26ms);
    BOOST_TEST(host.binds == 2);
    feed.on_bound("{\"v\":9}");
    BOOST_TEST(next() == "rebound");
    BOOST_TEST(next() == "current {\"v\":9}");
}

BOOST_AUTO_TEST_CASE(pauses_grow_while_the_publisher_is_unreachable_and_then_reset) {
    bound();
    lose();
    auto longest = 100ms;
    for (int i = 2; i < 12; ++i) {
        pass(longest * 3 / 4 - 1ms);
        BOOST_TEST(host.binds == i - 1);
        pass(longest / 4 + 1ms);
        BOOST_TEST(host.binds == i);
        feed.on_refused(errc::unavailable, "cannot connect", clock.now());
        longest = std::min(longest * 2, 5000ms);
    }
    BOOST_TEST(next() == "lost the link was lost");
    BOOST_TEST(next() == "(nothing)"); // failed attempts are not events
    pass(5s);
    feed.on_bound("{}");
    pass(5s);
    lose();
    const auto before = host.binds;
    pass(100ms);
    BOOST_TEST(host.binds == before + 1);
}

BOOST_AUTO_TEST_CASE(pauses_grow_while_bindings_live_for_a_short_time) {
    bound();
    lose();
    for (auto passed = 0ms; passed < 60s; passed += 10ms) {
        const auto before = host.binds;
        pass(10ms);
        if (host.binds != before) {
            feed.on_bound("{}");
            lose();
        }
    }
    BOOST_TEST(host.binds < 25); // 7 in the first 5 s, and then one every 4 to 5 s
}

BOOST_AUTO_TEST_CASE(the_gap_of_an_outage_is_reported) {
    bound();
    update(3);
    lose();
    pass(100ms);
    feed.on_bound("{}");
    update(7);
    for (const std::string_view expected :
         {"update 3 {}", "lost the link was lost", "rebound", "gap 3", "update 7 {}"}) {
        BOOST_TEST(next() == expected);
    }
}

BOOST_AUTO_TEST_CASE(a_restart_is_not_a_gap_and_old_incarnations_are_ignored) {
    bound();
    update(3);
    lose();
    pass(100ms);
    feed.on_bound("{}");
    update(1, "0000000b");
    update(4, "0000000a");
    for (const std::string_view expected :
         {"update 3 {}", "lost the link was lost", "rebound", "update 1 {}", "(nothing)"}) {
        BOOST_TEST(next() == expected);
    }
}

BOOST_AUTO_TEST_CASE(a_loss_while_it_is_not_bound_changes_nothing) {
    const auto result = begin();
    lose(); // the pending BIND is then refused
    BOOST_TEST(!result->ended);
    BOOST_TEST(next() == "(nothing)");
    feed.on_refused(errc::unavailable, "lost", clock.now());
    BOOST_TEST((result->code == errc::unavailable));
}

BOOST_AUTO_TEST_CASE(late_replies_change_nothing) {
    bound();
    feed.on_bound("{\"v\":1}");
    feed.on_refused(errc::failed, "late", clock.now());
    BOOST_TEST(next() == "(nothing)");
    BOOST_TEST(!feed.closed());
    pass(1h);
    BOOST_TEST(host.binds == 1);
}

BOOST_AUTO_TEST_CASE(closing_unbinds_once_and_ends_the_wait) {
    bound();
    wait w;
    feed.mail().next(cles::core::feed_machine::event_ptr{&w});
    feed.close(errc::cancelled);
    BOOST_TEST(w.text == "failed: the request was cancelled");
    BOOST_TEST(feed.closed());
    feed.close(errc::stopped);
    BOOST_TEST(host.unbinds == 1);
    update(1);
    feed.on_bound("{\"v\":1}");
    pass(1h);
    BOOST_TEST(host.binds == 1);
}

BOOST_AUTO_TEST_CASE(closing_fails_a_first_bind) {
    const auto result = begin();
    feed.close(errc::stopped);
    BOOST_TEST((result->code == errc::stopped));
}

BOOST_AUTO_TEST_CASE(closing_during_a_pause_ends_the_attempts) {
    bound();
    lose();
    feed.close(errc::cancelled);
    BOOST_TEST(deadlines.size() == 0U);
    pass(1h);
    BOOST_TEST(host.binds == 1);
}

BOOST_AUTO_TEST_CASE(a_wait_can_be_cancelled_without_harm_to_the_feed) {
    bound();
    wait w;
    feed.mail().next(cles::core::feed_machine::event_ptr{&w});
    feed.mail().cancel();
    BOOST_TEST(w.text == "failed: the request was cancelled");
    feed.mail().cancel();
    update(1);
    BOOST_TEST(next() == "update 1 {}");
}

BOOST_AUTO_TEST_CASE(an_available_event_is_delivered_by_pump_and_not_inside_next) {
    bound();
    update(1);
    wait w;
    BOOST_TEST(feed.mail().next(cles::core::feed_machine::event_ptr{&w}));
    BOOST_TEST(w.text == "(waiting)");
    update(2); // is queued after the first
    BOOST_TEST(w.text == "(waiting)");
    feed.mail().pump();
    BOOST_TEST(w.text == "update 1 {}");
    feed.mail().pump(); // nothing waits
    BOOST_TEST(next() == "update 2 {}");
}

BOOST_AUTO_TEST_CASE(a_slow_caller_gets_the_newest_updates_and_a_gap) {
    fixture small{cles::limits{.feed = 2}};
    small.bound();
    for (std::uint64_t seq = 1; seq <= 5; ++seq) {
        small.update(seq);
    }
    BOOST_TEST(small.next() == "gap 3");
    BOOST_TEST(small.next() == "update 4 {}");
    BOOST_TEST(small.next() == "update 5 {}");
}

BOOST_AUTO_TEST_CASE(a_feed_of_all_tracks_publishers_up_to_its_limit) {
    for (const std::size_t publishers : {1U, 2U}) {
        cles::core::feed_machine of_all{host,  deadlines, completions, {.publishers = publishers},
                                        "all", "speed",   false,       7};
        auto [operation, result] = cles::test::record();
        of_all.start(std::move(operation));
        of_all.on_bound("{}");
        const auto take = [&](const std::string& node) {
            const auto line = "UPDATE " + node + ":speed seq=5 epoch=0000000a {}";
            cles::protocol::request_line update;
            cles::protocol::malformed_request error;
            BOOST_REQUIRE(cles::protocol::parse_request(line, update, error));
            return of_all.take(update);
        };
        BOOST_TEST(take("car1"));
        BOOST_TEST(take("car2"));
        BOOST_TEST(take("car1") == (publishers == 1)); // forgotten meanwhile, so not a repeat
    }
}

// -- leases ----------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_binding_by_datagram_is_renewed_at_a_third_of_its_lease) {
    bound();
    const auto asked = clock.now();
    feed.on_leased(asked);
    pass(2s);
    BOOST_TEST(host.renewals == 0);
    pass(1s);
    BOOST_TEST(host.renewals == 1);
    BOOST_TEST((host.renew_until == asked + 9s));
    feed.on_renewed(clock.now());
    pass(3s);
    BOOST_TEST(host.renewals == 2);
    BOOST_TEST(next() == "(nothing)"); // a renewal is not reported
}

BOOST_AUTO_TEST_CASE(unanswered_renewals_lose_the_feed_which_binds_again) {
    bound();
    feed.on_leased(clock.now());
    pass(3s);
    const auto asked = clock.now();
    pass(6s);
    feed.on_renewal_refused(asked, errc::deadline, "no answer was received in time", clock.now());
    BOOST_TEST(host.detaches == 1);
    BOOST_TEST(next() == "lost the publisher did not renew the lease in time");
    pass(100ms);
    BOOST_TEST(host.binds == 2);
    feed.on_bound("[1]");
    feed.on_leased(clock.now());
    BOOST_TEST(next() == "rebound");
    BOOST_TEST(next() == "current [1]");
    pass(3s);
    BOOST_TEST(host.renewals == 2);
}

BOOST_AUTO_TEST_CASE(a_refused_renewal_loses_the_feed_at_once) {
    bound();
    feed.on_leased(clock.now());
    pass(3s);
    feed.on_renewal_refused(clock.now(), errc::no_task, "car1 has no BIND 'speed'", clock.now());
    BOOST_TEST(next() == "lost car1 has no BIND 'speed'");
}

BOOST_AUTO_TEST_CASE(a_busy_publisher_is_asked_to_renew_again) {
    bound();
    feed.on_leased(clock.now());
    pass(3s);
    feed.on_renewal_refused(clock.now(), errc::busy, "later", clock.now());
    BOOST_TEST(next() == "(nothing)");
    pass(2s);
    BOOST_TEST(host.renewals == 2);
}

BOOST_AUTO_TEST_CASE(a_last_value_too_large_for_a_renewal_does_not_lose_the_feed) {
    bound();
    feed.on_leased(clock.now());
    pass(3s);
    feed.on_renewal_refused(clock.now(), errc::too_large, "use TCP", clock.now());
    BOOST_TEST(next() == "(nothing)");
    pass(3s);
    BOOST_TEST(host.renewals == 2);
}

BOOST_AUTO_TEST_CASE(a_last_value_too_large_for_the_reply_does_not_refuse_a_repeated_bind) {
    begin();
    BOOST_TEST(!feed.is_bound_without_value(errc::too_large)); // the caller's message recommends TCP
    feed.on_bound("{}");
    lose();
    BOOST_TEST(next() == "lost the link was lost");
    pass(1s);
    BOOST_TEST(host.binds == 2);
    BOOST_TEST(!feed.is_bound_without_value(errc::busy));
    BOOST_REQUIRE(feed.is_bound_without_value(errc::too_large));
    feed.on_bound("{}");
    BOOST_TEST(next() == "rebound");
    BOOST_TEST(!feed.is_bound_without_value(errc::too_large)); // it is no longer binding
}

BOOST_AUTO_TEST_CASE(a_reply_to_a_renewal_of_an_earlier_binding_is_ignored) {
    bound();
    const auto asked = clock.now();
    feed.on_leased(asked);
    pass(3s);
    lose();
    pass(100ms);
    feed.on_bound("{}");
    feed.on_leased(clock.now());
    feed.on_renewal_refused(asked, errc::deadline, "", clock.now());
    BOOST_TEST(host.detaches == 0);
}

BOOST_AUTO_TEST_CASE(it_renews_at_a_third_of_the_lease_with_jitter) {
    std::set<cles::time_point> times;
    for (std::uint32_t seed = 1; seed < 100; ++seed) {
        cles::core::feed_machine one{host, deadlines, completions, {.lease = 9s}, "car1", "speed", false, seed * 7919};
        auto [operation, result] = cles::test::record();
        one.start(std::move(operation));
        one.on_bound("{}");
        const auto now = clock.now();
        one.on_leased(now);
        const auto due = *deadlines.next();
        BOOST_TEST((due >= now + 2250ms));
        BOOST_TEST((due <= now + 3s));
        times.insert(due);
    }
    BOOST_TEST(times.size() > 10U);
}

BOOST_AUTO_TEST_CASE(each_reply_renews_the_lease_from_the_time_of_the_request) {
    bound();
    const auto begun = clock.now();
    feed.on_leased(begun);
    pass(3s);
    BOOST_TEST(host.renewals == 1);
    BOOST_TEST((host.renew_until == begun + 9s)); // a later reply counts as none
    const auto asked = clock.now();
    pass(500ms);
    feed.on_renewed(asked);
    pass(2500ms);
    BOOST_TEST(host.renewals == 2);
    BOOST_TEST((host.renew_until == asked + 9s));
}

BOOST_AUTO_TEST_CASE(a_late_reply_is_followed_by_a_renewal_at_once) {
    bound();
    const auto asked = clock.now();
    clock.advance(4s);
    feed.on_leased(asked);
    pass(0ms);
    BOOST_TEST(host.renewals == 1);
}

BOOST_AUTO_TEST_CASE(a_busy_publisher_is_asked_again_until_the_lease_expires) {
    bound();
    const auto begun = clock.now();
    feed.on_leased(begun);
    pass(3s);
    int tries = 0;
    for (;;) {
        feed.on_renewal_refused(clock.now(), errc::busy, "later", clock.now());
        if (host.detaches != 0) {
            break;
        }
        const auto before = host.renewals;
        pass(std::chrono::duration_cast<std::chrono::milliseconds>(*deadlines.next() - clock.now()) + 1ms);
        BOOST_TEST(host.renewals == before + 1);
        BOOST_REQUIRE(++tries < 50);
    }
    BOOST_TEST(tries >= 3);
    BOOST_TEST((begun + 9s - clock.now() < 20ms));
    BOOST_TEST(next() == "lost later");
}

BOOST_AUTO_TEST_CASE(a_lost_feed_is_not_renewed) {
    bound();
    feed.on_leased(clock.now());
    lose();
    pass(1h);
    BOOST_TEST(host.renewals == 0);
}

BOOST_AUTO_TEST_CASE(a_closed_feed_is_not_renewed) {
    bound();
    feed.on_leased(clock.now());
    feed.close(errc::cancelled);
    pass(1h);
    BOOST_TEST(host.renewals == 0);
}

BOOST_AUTO_TEST_SUITE_END()
