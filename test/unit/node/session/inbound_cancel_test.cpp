// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>

namespace inbound_cancel {
namespace {

using cles::verb;

struct fixture {
    fixture() {
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on_later(verb::delegate, "work");
        node.on_later(verb::push, "store");
    }
    bool stopped(std::size_t i) { return node.started.at(i)->stopped; }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace inbound_cancel

BOOST_FIXTURE_TEST_SUITE(inbound_cancel, fixture)

BOOST_AUTO_TEST_CASE(a_request_in_flight_is_cancelled_and_answered_with_cancelled) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.ask("PUSH self:cles/cancel/7 id=8").ends_with("id=8 {}\n"));
    BOOST_TEST(stopped(0));
}

BOOST_AUTO_TEST_CASE(both_the_request_and_the_cancellation_are_answered) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7") == "id=7 cancelled, ok");
    link.ask("DELEGATE car1:work id=9");
    BOOST_TEST(link.kind("PUSH car1:cles/cancel/9") == "id=9 cancelled, ok"); // by the node's name too
}

BOOST_AUTO_TEST_CASE(the_reply_is_an_empty_object_whether_or_not_the_id_was_in_flight) {
    BOOST_TEST(link.ask("PUSH self:cles/cancel/7") == "{}\n");
    link.ask("DELEGATE car1:work id=7");
    node.started.at(0)->call->done("[1]");
    link.take();
    BOOST_TEST(link.ask("PUSH self:cles/cancel/7 id=8") == "id=8 {}\n"); // it had already ended
}

BOOST_AUTO_TEST_CASE(with_reply_no_only_the_cancelled_request_is_answered) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7 reply=no") == "id=7 cancelled");
}

BOOST_AUTO_TEST_CASE(it_cancels_on_its_own_link_only) {
    cles::test::test_link other{node};
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(other.kind("PUSH self:cles/cancel/7") == "ok");
    BOOST_TEST(!stopped(0));
}

BOOST_AUTO_TEST_CASE(it_cancels_the_named_request_only) {
    link.ask("DELEGATE car1:work id=7");
    link.ask("DELEGATE car1:work id=70");
    link.ask("PUSH self:cles/cancel/7");
    BOOST_TEST(stopped(0));
    BOOST_TEST(!stopped(1));
}

BOOST_AUTO_TEST_CASE(it_takes_effect_when_read_and_is_answered_in_its_turn) {
    link.ask("DELEGATE car1:work/anonymous");
    link.ask("DELEGATE car1:work/named id=7");
    link.ask("PULL car1:speed");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7") == "id=7 cancelled");
    BOOST_TEST(stopped(1));
    BOOST_TEST(!stopped(0));
    link.ask("PULL car1:speed");
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.take() == "[1]\n{\"v\":3}\n{}\n{\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(it_does_not_cancel_a_later_request_with_the_same_id) {
    link.ask("DELEGATE car1:work/anonymous");
    link.ask("DELEGATE car1:work id=7");
    link.ask("PUSH self:cles/cancel/7"); // takes effect at once, answered later
    link.ask("DELEGATE car1:work id=7");
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.sent() == "ok, ok");
    BOOST_TEST(!stopped(2));
}

BOOST_AUTO_TEST_CASE(it_takes_effect_at_the_limit_of_requests_in_flight) {
    cles::test::test_node small{cles::limits{.in_flight = 2}};
    small.on_later(verb::delegate, "work");
    cles::test::test_link busy{small};
    busy.ask("DELEGATE car1:work id=7");
    busy.ask("DELEGATE car1:work id=8");
    BOOST_TEST(busy.kind("DELEGATE car1:work id=9") == "id=9 busy");
    BOOST_TEST(busy.kind("PUSH self:cles/cancel/7") == "id=7 cancelled, ok");
    busy.ask("DELEGATE car1:work id=7");
    BOOST_TEST(busy.kind("PUSH self:cles/cancel/8 id=10") == "id=8 cancelled, id=10 ok");
}

BOOST_AUTO_TEST_CASE(requests_without_id_cannot_be_cancelled) {
    link.ask("DELEGATE car1:work");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/0 id=1") == "id=1 bad_request");
    BOOST_TEST(!stopped(0));
}

BOOST_AUTO_TEST_CASE(a_cancellation_without_a_valid_id_is_bad_request_also_while_another_request_runs) {
    for (const std::string_view line :
         {"PUSH self:cles/cancel/0", "PUSH self:cles/cancel/x", "PUSH self:cles/cancel/-1",
          "PUSH self:cles/cancel/9223372036854775808", "PUSH self:cles/cancel/7 {bad"}) {
        BOOST_TEST(link.kind(line) == "bad_request", line);
    }
    link.ask("DELEGATE car1:work");
    for (const std::string_view line :
         {"PUSH self:cles/cancel/0", "PUSH self:cles/cancel/9223372036854775808", "PUSH self:cles/cancel/7 {bad"}) {
        link.ask(line);
    }
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.sent() == "ok, bad_request, bad_request, bad_request");
}

BOOST_AUTO_TEST_CASE(a_denied_cancellation_has_no_effect) {
    cles::test::test_node strict{{}, [](const cles::access& a) { return a.task != "cles"; }};
    strict.on_later(verb::delegate, "work");
    cles::test::test_link guest{strict};
    guest.ask("DELEGATE car1:work id=7");
    BOOST_TEST(guest.kind("PUSH self:cles/cancel/7 id=8") == "id=8 denied");
    guest.ask("DELEGATE car1:work"); // from here on requests wait
    guest.ask("PUSH self:cles/cancel/7");
    BOOST_TEST(!strict.started.at(0)->stopped);
    strict.started.at(1)->call->done("[1]");
    BOOST_TEST(guest.sent() == "ok, denied");
}

BOOST_AUTO_TEST_CASE(a_cancellation_for_another_node_has_no_effect) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.kind("PUSH car2:cles/cancel/7 id=8") == "id=8 no_target");
    BOOST_TEST(link.kind("PUSH any:cles/cancel/7 id=8") == "id=8 no_target");
    BOOST_TEST(!stopped(0));
}

BOOST_AUTO_TEST_CASE(results_of_a_cancelled_handler_are_ignored) {
    link.ask("DELEGATE car1:work id=7 progress=yes");
    link.ask("PUSH self:cles/cancel/7");
    auto& call = *node.started.at(0)->call;
    BOOST_TEST(!call.progress(0.5, "{}"));
    call.done("[1]");
    call.fail({.code = cles::errc::failed, .message = "late"});
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(a_cancelled_request_with_reply_no_is_not_answered) {
    link.ask("PUSH car1:store id=7 reply=no");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7 id=8") == "id=8 ok");
    BOOST_TEST(stopped(0));
}

BOOST_AUTO_TEST_CASE(only_push_cancels) {
    link.ask("DELEGATE car1:work id=7");
    for (const std::string_view verb_name : {"PULL", "DELEGATE", "BIND", "UPDATE"}) {
        BOOST_TEST(link.kind(std::string{verb_name} + " self:cles/cancel/7 id=8") == "id=8 no_task", verb_name);
    }
    BOOST_TEST(!stopped(0));
}

BOOST_AUTO_TEST_CASE(a_handler_that_is_told_to_stop_may_cancel_another) {
    link.ask("DELEGATE car1:work id=7");
    link.ask("DELEGATE car1:work id=8");
    node.started.at(0)->call->on_stop([this] { node.started.at(1)->call->done("[2]"); });
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7") == "id=7 cancelled, id=8 ok, ok");
}

BOOST_AUTO_TEST_SUITE_END()
