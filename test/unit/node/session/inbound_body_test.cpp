// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace inbound_body {
namespace {

using cles::verb;

struct fixture {
    fixture() {
        node.on(verb::push, "log",
                [this](const cles::request& r, cles::json_writer&) { bodies += std::string{r.body()} + ";"; });
        node.on(verb::update, "notice",
                [this](const cles::request& r, cles::json_writer&) { bodies += std::string{r.body()} + ";"; });
        node.on_later(verb::delegate, "work");
    }
    cles::test::test_node node;
    cles::test::test_link link{node};
    std::string bodies;
};

std::string nested(std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); }

} // namespace
} // namespace inbound_body

BOOST_FIXTURE_TEST_SUITE(inbound_body, fixture)

BOOST_AUTO_TEST_CASE(a_missing_body_counts_as_an_empty_object) {
    link.ask("PUSH car1:log");
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(bodies == "{};");
    BOOST_TEST(node.started.at(0)->body == "{}");
}

BOOST_AUTO_TEST_CASE(the_body_is_the_rest_of_the_line) {
    link.ask("PUSH car1:log id=7 {\"text\":\"id=8 {}\"}");
    link.ask("PUSH car1:log   [1, 2,  3]  ");
    BOOST_TEST(bodies == "{\"text\":\"id=8 {}\"};[1, 2,  3];");
}

BOOST_AUTO_TEST_CASE(a_body_is_an_object_or_an_array) {
    for (const std::string_view body : {"5", "\"x\"", "true", "null", "x"}) {
        BOOST_TEST(link.kind("PUSH car1:log " + std::string{body}) == "bad_request", body);
    }
    BOOST_TEST(bodies.empty());
}

BOOST_AUTO_TEST_CASE(a_body_is_validated_before_its_handler_runs_and_the_message_says_where) {
    struct example {
        std::string_view body;
        std::string_view says;
    };
    const example examples[] = {
        {"{", "byte 1"},
        {"[1,]", "byte 3"},
        {"{\"a\":}", "byte 5"},
        {"{\"a\" 1}", "':'"},
        {"{a:1}", "byte 1"},
        {"[01]", "leading zeros"},
        {"[\"\xFF\"]", "UTF-8"},
        {"[\"\\x\"]", "escape"},
        {"[\"\\uD800\"]", "surrogate"},
        {"[\"a\x01\"]", "control"},
        {"{} {}", "after the value"},
        {"[1] id=7", "after the value"},
        {"[nul]", "null"},
        {"[\"abc]", "without an end"},
    };
    for (const auto& e : examples) {
        for (const std::string head : {"PUSH car1:log ", "DELEGATE car1:work ", "UPDATE car1:notice "}) {
            const auto reply = link.reply(head + std::string{e.body});
            BOOST_TEST(reply.error == "bad_request", head << e.body);
            BOOST_TEST(reply.message.find(e.says) != std::string::npos, head << e.body << " gives: " << reply.message);
            BOOST_TEST(reply.message.find("car1") != std::string::npos, reply.message);
        }
    }
    BOOST_TEST(bodies.empty());
    BOOST_TEST(node.started.empty());
    BOOST_TEST(link.finishes == 0);
}

BOOST_AUTO_TEST_CASE(json_is_32_brackets_deep_at_most) {
    BOOST_TEST(link.kind("PUSH car1:log " + nested(32)) == "ok");
    const auto reply = link.reply("PUSH car1:log " + nested(33));
    BOOST_TEST(reply.error == "bad_request");
    BOOST_TEST(reply.message.find("32") != std::string::npos);
    BOOST_TEST(link.kind("PUSH car1:log " + nested(100'000)) == "bad_request");
    std::string mixed;
    for (int i = 0; i < 16; ++i) {
        mixed += "{\"a\":[";
    }
    for (int i = 0; i < 16; ++i) {
        mixed += "]}";
    }
    BOOST_TEST(link.kind("PUSH car1:log " + mixed) == "ok");
}

BOOST_AUTO_TEST_CASE(the_depth_is_configurable) {
    cles::test::test_node flat{cles::limits{.depth = 2}};
    flat.on(verb::push, "log", std::string{});
    cles::test::test_link to{flat};
    BOOST_TEST(to.kind("PUSH car1:log [[1]]") == "ok");
    BOOST_TEST(to.kind("PUSH car1:log [[[1]]]") == "bad_request");
}

BOOST_AUTO_TEST_CASE(pull_and_bind_take_no_body) {
    node.on(verb::pull, "speed", "[1]");
    node.open("speed");
    for (const std::string_view line :
         {"PULL car1:speed {}", "PULL car1:speed []", "BIND car1:speed {}", "PULL self:cles {\"a\":1}"}) {
        BOOST_TEST(link.kind(line) == "bad_request", line);
    }
}

BOOST_AUTO_TEST_CASE(an_update_request_whose_first_key_is_error_is_bad_request) {
    for (const std::string_view body : {"{\"error\":1}", "{ \"error\" : \"x\" }", "{\"\\u0065rror\":1}"}) {
        BOOST_TEST(link.kind("UPDATE car1:notice " + std::string{body}) == "bad_request", body);
    }
    BOOST_TEST(bodies.empty());
    BOOST_TEST(link.kind("UPDATE car1:notice {\"a\":1,\"error\":1}") == "ok");
    BOOST_TEST(link.kind("PUSH car1:log {\"error\":1}") == "ok"); // a PUSH may have such a body
}

BOOST_AUTO_TEST_SUITE_END()
