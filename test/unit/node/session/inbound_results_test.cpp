// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <stdexcept>
#include <string>
#include <string_view>

namespace inbound_results {
namespace {

using cles::errc;
using cles::verb;

struct fixture {
    /// The replies of a plain handler and of one that replies later, for the same result.
    std::string both(std::string_view json) {
        cles::test::test_node fresh;
        cles::test::test_link to{fresh};
        fresh.on(verb::pull, "plain", std::string{json});
        fresh.on_later(verb::pull, "later");
        const auto now = to.ask("PULL car1:plain id=7");
        to.ask("PULL car1:later id=7");
        fresh.started.at(0)->call->done(json);
        const auto later = to.take();
        return now == later ? now : "plain: " + now + "later: " + later;
    }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace inbound_results

BOOST_FIXTURE_TEST_SUITE(inbound_results, fixture)

BOOST_AUTO_TEST_CASE(an_object_or_an_array_is_sent_unchanged) {
    BOOST_TEST(both("{\"a\":{\"b\":[1,2]}}") == "id=7 {\"a\":{\"b\":[1,2]}}\n");
    BOOST_TEST(both("[1,{\"error\":1}]") == "id=7 [1,{\"error\":1}]\n");
    BOOST_TEST(both("{}") == "id=7 {}\n");
    BOOST_TEST(both("[]") == "id=7 []\n");
}

BOOST_AUTO_TEST_CASE(a_scalar_is_wrapped_as_value) {
    BOOST_TEST(both("5") == "id=7 {\"value\":5}\n");
    BOOST_TEST(both("-0.5") == "id=7 {\"value\":-0.5}\n");
    BOOST_TEST(both("true") == "id=7 {\"value\":true}\n");
    BOOST_TEST(both("null") == "id=7 {\"value\":null}\n");
    BOOST_TEST(both("\"{}\"") == "id=7 {\"value\":\"{}\"}\n");
}

BOOST_AUTO_TEST_CASE(nothing_is_an_empty_object) { BOOST_TEST(both("") == "id=7 {}\n"); }

BOOST_AUTO_TEST_CASE(a_success_whose_first_key_is_error_becomes_failed) {
    for (const std::string_view body :
         {"{\"error\":\"busy\"}", "{\"error\":5}", "{\"error\":{},\"a\":1}", "{\"err\\u006fr\":1}"}) {
        const auto answer = both(body);
        BOOST_TEST(answer.starts_with("id=7 {\"error\":\"failed\""), answer);
    }
    BOOST_TEST(both("{\"a\":1,\"error\":\"busy\"}") == "id=7 {\"a\":1,\"error\":\"busy\"}\n");
    BOOST_TEST(both("{\"errors\":5}") == "id=7 {\"errors\":5}\n");
}

BOOST_AUTO_TEST_CASE(a_reply_over_the_limit_is_too_large_and_says_that_the_handler_ran) {
    cles::test::test_node small{cles::limits{.line = 200}};
    cles::test::test_link to{small};
    small.on(verb::pull, "fits", "[\"" + std::string(191, 'x') + "\"]"); // 200 bytes with its id
    small.on(verb::pull, "large", "[\"" + std::string(192, 'x') + "\"]");
    small.on_later(verb::pull, "later");
    BOOST_TEST(to.ask("PULL car1:fits id=7").size() == 201U);
    const auto now = to.reply("PULL car1:large id=7");
    BOOST_TEST(now.error == "too_large");
    BOOST_TEST(now.ran);
    to.ask("PULL car1:later id=7");
    small.started.at(0)->call->done("[\"" + std::string(192, 'x') + "\"]");
    const auto later = cles::test::read_reply(to.take_lines().at(0));
    BOOST_TEST(later.error == "too_large");
    BOOST_TEST(later.ran);
    BOOST_TEST(to.kind("PULL car1:large") == "ok"); // fits without its id
    BOOST_TEST(to.finishes == 0);
}

BOOST_AUTO_TEST_CASE(an_exception_of_a_handler_becomes_the_reply) {
    node.on(verb::pull, "sensor", [](const cles::request&, cles::json_writer& w) {
        w.begin_object(); // half a result
        throw std::runtime_error{"the sensor is off, see /etc/sensor"};
    });
    node.on(verb::pull, "odd", [](const cles::request&, cles::json_writer&) { throw 42; });
    node.on(verb::pull, "guard", [](const cles::request&, cles::json_writer&) {
        throw cles::error{errc::denied, "not today"};
    });
    BOOST_TEST(link.ask("PULL car1:sensor id=7") ==
               "id=7 {\"error\":\"failed\",\"message\":\"car1: the sensor is off, see ...\"}\n");
    BOOST_TEST(link.kind("PULL car1:odd") == "failed");
    BOOST_TEST(link.ask("PULL car1:guard") == "{\"error\":\"denied\",\"message\":\"car1: not today\"}\n");
}

BOOST_AUTO_TEST_CASE(an_exception_at_the_start_of_an_asynchronous_handler_becomes_the_reply) {
    node.host->tasks.add(verb::pull, "sensor",
                         {.start = [](const cles::request&, const std::shared_ptr<cles::core::call>&) {
                             throw std::runtime_error{"off"};
                         }});
    BOOST_TEST(link.ask("PULL car1:sensor id=7") == "id=7 {\"error\":\"failed\",\"message\":\"car1: off\"}\n");
    BOOST_TEST(link.kind("PULL car1:sensor id=7") == "id=7 failed"); // it is no longer in flight
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(a_failure_fits_into_a_line_whatever_its_message) {
    for (std::size_t limit = 300; limit < 360; ++limit) {
        cles::test::test_node small{cles::limits{.line = limit}};
        cles::test::test_link to{small};
        small.on(verb::pull, "chatty", [](const cles::request&, cles::json_writer&) {
            std::string text;
            for (int i = 0; i < 400; ++i) {
                text += "\xC3\xA4\n\"";
            }
            throw std::runtime_error{text};
        });
        const auto answer = to.ask("PULL car1:chatty id=7");
        BOOST_TEST(answer.size() <= limit + 1);
        const auto reply = cles::test::read_reply(std::string_view{answer}.substr(0, answer.size() - 1));
        BOOST_TEST(reply.error == "failed");
        BOOST_TEST(reply.message.starts_with("car1: \xC3\xA4\\n\""), reply.message);
        BOOST_TEST(reply.message.find("\xEF\xBF\xBD") == std::string::npos); // not truncated inside a character
    }
}

BOOST_AUTO_TEST_CASE(the_first_reply_counts) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE car1:work id=7");
    auto& call = *node.started.at(0)->call;
    call.done("[1]");
    call.done("[2]");
    call.fail({.code = errc::failed, .message = "x"});
    BOOST_TEST(link.take() == "id=7 [1]\n");
}

BOOST_AUTO_TEST_CASE(reply_no_suppresses_results_and_errors_and_errors_are_counted) {
    int ran = 0;
    node.on(verb::push, "log", [&](const cles::request&, cles::json_writer&) { ++ran; });
    node.on(verb::push, "sensor", [](const cles::request&, cles::json_writer&) { throw std::runtime_error{"off"}; });
    node.on_later(verb::push, "store");
    BOOST_TEST(link.ask("PUSH car1:log reply=no").empty());
    BOOST_TEST(link.ask("PUSH car1:log reply=no id=7").empty());
    BOOST_TEST(ran == 2);
    BOOST_TEST(node.counts().errors_unsent == 0U);
    for (const std::string_view line : {"PUSH car1:sensor reply=no", "PUSH car1:none reply=no",
                                        "PUSH car9:log reply=no", "PUSH car1:log reply=no {bad"}) {
        BOOST_TEST(link.ask(line).empty(), line);
    }
    BOOST_TEST(node.counts().errors_unsent == 4U);
    BOOST_TEST(node.counts().errors == 0U);
    link.ask("PUSH car1:store reply=no");
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(link.kind("PULL car1:none reply=no") == "no_task"); // on other verbs it is ignored
}

BOOST_AUTO_TEST_CASE(an_update_published_by_a_handler_does_not_mix_with_its_reply) {
    node.open("pose");
    node.on(verb::push, "move", [&](const cles::request&, cles::json_writer& w) {
        w.begin_array();
        node.publish_now("pose", "[1]");
        w.end_array();
    });
    link.ask("BIND car1:pose");
    BOOST_TEST(link.ask("PUSH car1:move") == "UPDATE car1:pose seq=1 epoch=5f3a09c1 [1]\n[]\n");
}

BOOST_AUTO_TEST_SUITE_END()
