// SPDX-License-Identifier: BSL-1.0
#include "node/session/call.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <optional>

namespace call {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    fixture() {
        node.on_later(verb::delegate, "work");
        link.ask("DELEGATE car1:work id=7 deadline=100");
        call = node.started.at(0)->call;
        call->on_stop([this] { ++stops; });
    }
    cles::test::test_node node;
    cles::test::test_link link{node};
    std::shared_ptr<cles::core::call> call;
    int stops = 0;
};

} // namespace
} // namespace call

BOOST_FIXTURE_TEST_SUITE(call, fixture)

BOOST_AUTO_TEST_CASE(a_handlers_own_answer_does_not_stop_it) {
    call->done("[1]");
    BOOST_TEST(call->ended());
    BOOST_TEST(!call->stopped());
    BOOST_TEST(stops == 0);
}

BOOST_AUTO_TEST_CASE(deadline_cancellation_and_loss_of_its_link_stop_it_once) {
    for (int how = 0; how < 3; ++how) {
        fixture f;
        switch (how) {
        case 0: f.node.pass(100ms); break;
        case 1: f.link.ask("PUSH self:cles/cancel/7"); break;
        default: f.link.reset();
        }
        BOOST_TEST(f.stops == 1);
        BOOST_TEST(f.call->stopped());
        BOOST_TEST(f.call->ended());
        f.node.pass(1h);
        f.link.reset();
        BOOST_TEST(f.stops == 1);
    }
}

BOOST_AUTO_TEST_CASE(on_stop_after_the_stop_calls_at_once) {
    node.pass(100ms);
    bool told = false;
    call->on_stop([&] { told = true; });
    BOOST_TEST(told);
}

BOOST_AUTO_TEST_CASE(on_stop_after_the_reply_does_not_call) {
    call->done("[1]");
    bool told = false;
    call->on_stop([&] { told = true; });
    node.pass(1h);
    link.reset();
    BOOST_TEST(!told);
}

BOOST_AUTO_TEST_CASE(it_may_answer_from_inside_its_stop_without_effect) {
    call->on_stop([this] { call->done("[1]"); });
    node.pass(100ms);
    BOOST_TEST(link.sent() == "id=7 deadline");
}

BOOST_AUTO_TEST_CASE(a_reply_outside_of_a_line_wakes_the_link) {
    const auto before = link.wakes;
    call->done("[1]");
    BOOST_TEST(link.wakes > before);
}

BOOST_AUTO_TEST_CASE(it_may_outlive_its_node) {
    std::shared_ptr<cles::core::call> kept;
    {
        cles::test::test_node brief;
        brief.on_later(verb::delegate, "work");
        cles::test::test_link to{brief};
        to.ask("DELEGATE car1:work id=7");
        kept = brief.started.at(0)->call;
    }
    BOOST_TEST(kept->stopped());
    kept->done("[1]");
    kept->progress(0.5, "{}");
}

BOOST_AUTO_TEST_SUITE_END()
