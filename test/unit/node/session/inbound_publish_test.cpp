// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <stdexcept>
#include <string>
#include <string_view>

namespace inbound_publish {
namespace {

using cles::verb;

struct fixture {
    fixture() {
        node.on(verb::update, "notice", [this](const cles::request&, cles::json_writer&) { ++ran; });
        node.on_later(verb::update, "slow");
    }
    cles::test::test_node node;
    cles::test::test_link link{node};
    cles::test::test_link subscriber{node};
    int ran = 0;
};

} // namespace
} // namespace inbound_publish

BOOST_FIXTURE_TEST_SUITE(inbound_publish, fixture)

BOOST_AUTO_TEST_CASE(an_update_request_runs_its_handler_then_the_body_goes_to_all_bound) {
    subscriber.ask("BIND car1:notice");
    link.ask("BIND car1:notice");
    BOOST_TEST(link.ask("UPDATE car1:notice id=7 {\"text\": \"a b\"}") == "id=7 {}\n");
    BOOST_TEST(ran == 1);
    node.drain();
    const std::string expected = "UPDATE car1:notice seq=1 epoch=5f3a09c1 {\"text\":\"a b\"}\n";
    BOOST_TEST(subscriber.take() == expected);
    BOOST_TEST(link.take() == expected);
}

BOOST_AUTO_TEST_CASE(registering_its_handler_opens_the_task_for_bind) {
    BOOST_TEST(subscriber.ask("BIND car1:notice/left") == "{}\n");
}

BOOST_AUTO_TEST_CASE(a_task_that_can_only_be_bound_refuses_update_requests) {
    node.open("pose");
    BOOST_TEST(link.kind("UPDATE car1:pose {}") == "no_task");
}

BOOST_AUTO_TEST_CASE(the_body_is_published_without_white_space_and_a_missing_one_as_an_empty_object) {
    link.ask("UPDATE car1:notice { \"a b\" : [ 1 , \" \\\" \" ] }");
    BOOST_TEST(subscriber.ask("BIND car1:notice") == "{\"a b\":[1,\" \\\" \"]}\n");
    link.ask("UPDATE car1:notice");
    BOOST_TEST(subscriber.ask("BIND car1:notice") == "{}\n");
}

BOOST_AUTO_TEST_CASE(parameters_belong_to_the_noun_that_is_published) {
    subscriber.ask("BIND car1:notice/a%41");
    link.ask("UPDATE car1:notice/%61%41 [1]");
    node.drain();
    BOOST_TEST(subscriber.take() == "UPDATE car1:notice/aA seq=1 epoch=5f3a09c1 [1]\n");
}

BOOST_AUTO_TEST_CASE(what_the_handler_returns_is_the_reply) {
    node.on(verb::update, "counted", "5");
    BOOST_TEST(link.ask("UPDATE car1:counted [1]") == "{\"value\":5}\n");
}

BOOST_AUTO_TEST_CASE(a_handler_that_throws_publishes_nothing) {
    node.on(verb::update, "guarded", [](const cles::request&, cles::json_writer&) { throw std::runtime_error{"no"}; });
    BOOST_TEST(link.kind("UPDATE car1:guarded [1]") == "failed");
    BOOST_TEST(node.counts().updates_published == 0U);
}

BOOST_AUTO_TEST_CASE(a_handler_that_answers_later_publishes_when_it_has_succeeded) {
    subscriber.ask("BIND car1:slow");
    link.ask("UPDATE car1:slow/a%41 id=7 [ 1 ]");
    link.ask("UPDATE car1:slow id=8 [2]");
    BOOST_TEST(node.counts().updates_published == 0U);
    node.started.at(1)->call->done("");
    BOOST_TEST(link.take() == "id=8 {}\n");
    node.started.at(0)->call->fail({.code = cles::errc::failed, .message = "no"});
    node.drain();
    BOOST_TEST(subscriber.take() == "UPDATE car1:slow seq=1 epoch=5f3a09c1 [2]\n");
    BOOST_TEST(node.counts().updates_published == 1U);
}

BOOST_AUTO_TEST_CASE(a_cancelled_request_publishes_nothing) {
    link.ask("UPDATE car1:slow id=7 [1]");
    link.ask("PUSH self:cles/cancel/7");
    node.started.at(0)->call->done("");
    BOOST_TEST(node.counts().updates_published == 0U);
}

BOOST_AUTO_TEST_CASE(reply_no_publishes_without_an_answer) {
    BOOST_TEST(link.ask("UPDATE car1:notice reply=no [1]").empty());
    BOOST_TEST(node.counts().updates_published == 1U);
}

BOOST_AUTO_TEST_CASE(a_request_to_publish_waits_its_turn) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE car1:work");
    link.ask("UPDATE car1:notice [1]");
    BOOST_TEST(ran == 0);
    node.started.at(0)->call->done("[9]");
    BOOST_TEST(link.take() == "[9]\n{}\n");
    BOOST_TEST(ran == 1);
}

BOOST_AUTO_TEST_CASE(an_update_too_long_for_a_line_says_that_the_handler_ran) {
    // "UPDATE car1:notice seq=1 epoch=5f3a09c1 " is longer than what the request had before its body.
    cles::test::test_node small{cles::limits{.line = 100}};
    small.on(verb::update, "notice", std::string{});
    small.on_later(verb::update, "slow");
    cles::test::test_link to{small};
    const auto body = "[\"" + std::string(66, 'x') + "\"]";
    const auto now = to.reply("UPDATE car1:notice " + body);
    BOOST_TEST(now.error == "too_large");
    BOOST_TEST(now.ran);
    to.ask("UPDATE car1:slow " + body);
    small.started.at(0)->call->done("");
    const auto later = cles::test::read_reply(to.take_lines().at(0));
    BOOST_TEST(later.error == "too_large");
    BOOST_TEST(later.ran);
}

BOOST_AUTO_TEST_CASE(a_noun_beyond_the_limit_is_busy_before_the_handler_runs) {
    cles::test::test_node small{cles::limits{.nouns = 2}};
    int runs = 0;
    small.on(verb::update, "notice", [&](const cles::request&, cles::json_writer&) { ++runs; });
    small.on_later(verb::update, "slow");
    cles::test::test_link to{small};
    BOOST_TEST(to.kind("BIND car1:notice/a") == "ok"); // bound nouns do not retire
    BOOST_TEST(to.kind("BIND car1:notice/b") == "ok");
    BOOST_TEST(to.kind("UPDATE car1:notice/a [1]") == "ok");
    BOOST_TEST(to.kind("UPDATE car1:notice/b [1]") == "ok");
    const auto third = to.reply("UPDATE car1:notice/c [1]");
    BOOST_TEST(third.error == "busy");
    BOOST_TEST(third.retry_ms.value_or(0) > 0U);
    BOOST_TEST(runs == 2);
    BOOST_TEST(to.kind("UPDATE car1:notice/b [2]") == "ok");
    to.ask("BIND car1:slow/a");
    to.ask("BIND car1:slow/b");
    small.publish_now("slow/a", "[1]");
    small.publish_now("slow/b", "[1]");
    to.take();
    BOOST_TEST(to.kind("UPDATE car1:slow/c [1]") == "busy");
    BOOST_TEST(small.started.empty());
}

BOOST_AUTO_TEST_SUITE_END()
