// SPDX-License-Identifier: BSL-1.0
// Scenarios that are replayed with a failure at the first step of their input and output, then at the second, and so on
// until one passes without a failure. Wherever it fails: every operation completes exactly once, nothing hangs, nothing
// leaks, and afterwards everything works again.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/fault_transport.hpp"
#include "support/feed_log.hpp"
#include "support/run_until.hpp"

#include <boost/asio/error.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(fault_replay)

using namespace cles::test;
using cles::errc;

constexpr std::array every_fault{fault::lost, fault::cut, fault::ended};

// A publisher and its client, on links that fail as planned.
struct nodes {
    nodes() {
        car.on_pull("speed", [] { return 42; });
        car.on_push("echo", [this](const cles::request& r) {
            ++pushed;
            return cles::json_text{std::string{r.body()}};
        });
        car.on_delegate("drive", [](const cles::request&, cles::responder r) {
            boost::asio::post(r.get_executor(), [r]() mutable {
                r.progress(0.5);
                boost::asio::post(r.get_executor(), [r]() mutable { r.done(7); });
            });
        });
        car.on_bind("place");
    }

    boost::asio::io_context io;
    int pushed = 0;
    cles::service car{io, {.name = "car1", .listen = {"fault://car1"}}};
    cles::service tower{io, {.name = "tower", .peers = {{"car1", "fault://car1"}}}};
};

// A peer that receives an end of the link withdraws what is in flight, and may still be able to send that.
bool is_a_loss(const boost::system::error_code& code) {
    return code == errc::unavailable || code == boost::asio::error::connection_refused ||
           (code == errc::cancelled && fault_plan::instance().how() == fault::ended);
}

template <class T>
void check_ended_once(const answer<T>& a) {
    BOOST_TEST(a.calls == 1);
    BOOST_TEST((!a.code || is_a_loss(a.code)), a.code.message());
    BOOST_TEST((!a.code || !a.words.empty()));
}

// Runs the scenario with a failure at each of its steps.
void replay(fault how, const std::function<void(nodes&)>& scenario) {
    register_fault_transport();
    auto& plan = fault_plan::instance();
    constexpr int too_many = 500;
    int step = 0;
    for (bool struck = true; struck; ++step) {
        BOOST_REQUIRE(step < too_many);
        BOOST_TEST_CONTEXT("failure at step " << step) {
            plan.arm(how, step);
            auto n = std::make_unique<nodes>();
            scenario(*n);
            struck = plan.struck();
            plan.disarm();

            answer<int> afterwards;
            n->tower.async_pull<int>("car1:speed", afterwards.options(), afterwards.take());
            run_until(n->io, [&] { return afterwards.done(); });
            BOOST_TEST(!afterwards.code, afterwards.words);
            BOOST_TEST(afterwards.value == 42);
            n.reset();
            BOOST_TEST(plan.links() == 0);
        }
    }
    BOOST_TEST(step > 5);
}

CLES_DATA_TEST_CASE(a_pull, every_fault, how) {
    replay(how, [](nodes& n) {
        answer<int> a;
        n.tower.async_pull<int>("car1:speed", a.options(), a.take());
        run_until(n.io, [&] { return a.done(); });
        check_ended_once(a);
        BOOST_TEST((a.code || a.value == 42));
    });
}

CLES_DATA_TEST_CASE(all_verbs_at_once, every_fault, how) {
    replay(how, [](nodes& n) {
        answer<int> pull;
        answer<> push;
        answer<int> drive;
        double reported = 0;
        auto options = drive.options().on_progress([&](double fraction, std::string_view) { reported = fraction; });
        n.tower.async_pull<int>("car1:speed", pull.options(), pull.take());
        n.tower.async_push("car1:echo", cles::json_text{R"({"a":1})"}, push.options(), push.take());
        n.tower.async_delegate<int>("car1:drive", cles::json_text{}, options, drive.take());
        run_until(n.io, [&] { return pull.done() && push.done() && drive.done(); });
        run_ready(n.io);
        check_ended_once(pull);
        check_ended_once(push);
        check_ended_once(drive);
        BOOST_TEST(n.pushed <= 1); // never repeated automatically
        BOOST_TEST((push.code || n.pushed == 1));
        BOOST_TEST((drive.code || (drive.value == 7 && reported == 0.5)));
    });
}

CLES_DATA_TEST_CASE(requests_one_after_another, every_fault, how) {
    replay(how, [](nodes& n) {
        int failed = 0;
        for (int i = 0; i < 4; ++i) {
            answer<int> a;
            n.tower.async_pull<int>("car1:speed", a.options(), a.take());
            run_until(n.io, [&] { return a.done(); });
            check_ended_once(a);
            failed += a.code.failed() ? 1 : 0;
        }
        BOOST_TEST(failed <= 1);
    });
}

CLES_DATA_TEST_CASE(a_withdrawal, every_fault, how) {
    replay(how, [](nodes& n) {
        std::vector<cles::responder> kept;
        n.car.on_delegate("wait", [&](const cles::request&, cles::responder r) { kept.push_back(std::move(r)); });
        answer<> a;
        boost::asio::cancellation_signal signal;
        n.tower.async_delegate("car1:wait", cles::json_text{}, a.options(),
                               boost::asio::bind_cancellation_slot(signal.slot(), a.take()));
        run_until(n.io, [&] { return !kept.empty() || a.done(); });
        signal.emit(boost::asio::cancellation_type::terminal);
        run_until(n.io, [&] { return a.done(); });
        BOOST_TEST(a.calls == 1);
        BOOST_TEST((a.code == errc::cancelled || is_a_loss(a.code)), a.code.message());
        // The handler is notified, by the withdrawal or by the loss of the link.
        run_until(n.io, [&] { return kept.empty() || kept.front().stopped(); });
        run_ready(n.io);
        BOOST_TEST(a.calls == 1);
    });
}

CLES_DATA_TEST_CASE(a_feed_catches_up_in_the_end, every_fault, how) {
    replay(how, [](nodes& n) {
        n.car.update("place", 1);
        feed_log feed;
        feed.bind(n.tower, "car1:place");
        run_until(n.io, [&] { return feed.binds != 0; });
        BOOST_TEST(feed.binds == 1);
        if (!feed.bound) {
            BOOST_TEST(is_a_loss(feed.code), feed.code.message());
            return;
        }
        for (int i = 2; i <= 4; ++i) {
            answer<void> published;
            n.car.async_update("place", i, published.take());
            run_until(n.io, [&] { return published.done(); });
            BOOST_TEST(!published.code);
            run_ready(n.io);
        }
        run_until(n.io, [&] { return !feed.items.empty() && feed.items.back().value.text == R"({"value":4})"; });
        BOOST_TEST(!feed.is_over());
        BOOST_TEST(feed.count(cles::feed_event::lost) == feed.count(cles::feed_event::rebound));
        BOOST_TEST(feed.count(cles::feed_event::lost) <= 1U);
    });
}

CLES_DATA_TEST_CASE(two_feeds_and_a_close, every_fault, how) {
    replay(how, [](nodes& n) {
        feed_log stays;
        feed_log goes;
        stays.bind(n.tower, "car1:place");
        goes.bind(n.tower, "car1:place");
        run_until(n.io, [&] { return stays.binds != 0 && goes.binds != 0; });
        const bool bound = goes.bound;
        goes.close();
        run_until(n.io, [&] { return !bound || goes.is_over(); });
        n.car.update("place", 1);
        run_until(n.io, [&] {
            return !stays.bound || (!stays.items.empty() && stays.items.back().value.text == R"({"value":1})");
        });
        BOOST_TEST(goes.ends <= 1);
    });
}

// Requests use the link that the feed is on.
CLES_DATA_TEST_CASE(requests_beside_a_feed, every_fault, how) {
    replay(how, [](nodes& n) {
        feed_log feed;
        feed.bind(n.tower, "car1:place");
        run_until(n.io, [&] { return feed.binds != 0; });
        for (int i = 0; i < 2; ++i) {
            answer<int> a;
            n.tower.async_pull<int>("car1:speed", a.options(), a.take());
            run_until(n.io, [&] { return a.done(); });
            check_ended_once(a);
        }
    });
}

// Destroys everything in the middle of any operation.
CLES_DATA_TEST_CASE(a_stop, every_fault, how) {
    replay(how, [](nodes& n) {
        answer<int> pull;
        answer<int> drive;
        feed_log feed;
        n.car.update("place", 1);
        cles::service guest{n.io, {.name = "guest", .peers = {{"car1", "fault://car1"}}}};
        guest.async_pull<int>("car1:speed", pull.options(), pull.take());
        guest.async_delegate<int>("car1:drive", cles::json_text{}, drive.options(), drive.take());
        feed.bind(guest, "car1:place");
        for (int i = 0; i < 6; ++i) {
            n.io.poll_one();
        }
        guest.stop();
        run_until(n.io, [&] { return pull.done() && drive.done() && feed.binds != 0; });
        run_ready(n.io);
        for (const auto* a : {&pull, &drive}) {
            BOOST_TEST(a->calls == 1);
            BOOST_TEST((!a->code || a->code == errc::stopped || is_a_loss(a->code)), a->code.message());
        }
        BOOST_TEST(feed.binds == 1);
    });
}

BOOST_AUTO_TEST_SUITE_END()
