// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace inbound_malformed {
namespace {

using cles::verb;

struct fixture {
    fixture() {
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on(verb::push, "log", std::string{});
        node.on(verb::update, "notice", std::string{});
        node.on_later(verb::delegate, "work");
        node.open("speed");
    }
    cles::test::test_node node;
    cles::test::test_link link{node};
};

std::string repeated(std::string_view text, std::size_t times) {
    std::string out;
    for (std::size_t i = 0; i < times; ++i) {
        out += text;
    }
    return out;
}

} // namespace
} // namespace inbound_malformed

BOOST_FIXTURE_TEST_SUITE(inbound_malformed, fixture)

BOOST_AUTO_TEST_CASE(every_malformed_line_is_bad_request_and_says_what_is_wrong_and_the_link_stays_open) {
    struct example {
        std::string line;
        std::string_view says;
    };
    const example examples[] = {
        {"FLY car1:speed", "'FLY'"},
        {"hello", "'hello'"},
        {"PULL", "noun"},
        {"PULL speed", "':'"},
        {"PULL :speed", "target"},
        {"PULL car1:", "task"},
        {"PULL car1:speed/", "parameter 1 is empty"},
        {"PULL car1:speed//a", "parameter 1 is empty"},
        {"PULL car1:speed/%0A", "parameter 1"},
        {"PULL car1:speed/%4", "parameter 1"},
        {"PULL car1:speed/a/%FF", "parameter 2"},
        {"PULL car1:speed" + repeated("/p", 33), "32"},
        {"PULL " + std::string(65, 'n') + ":speed", "target"},
        {"PULL car1:" + std::string(65, 'n'), "task"},
        {"PULL car1:speed" + repeated(" x=1", 17), "16"},
        {"PULL car1:speed nonsense", "'nonsense'"},
        {"PULL car1:speed 5", "'5'"},
        {"PULL car1:speed deadline=0", "'deadline'"},
        {"PULL car1:speed deadline=86400001", "'deadline'"},
        {"PULL car1:speed deadline=1 deadline=1", "'deadline' occurs twice"},
        {"PULL car1:speed id=0", "'id'"},
        {"PULL car1:speed id=9223372036854775808", "'id'"},
        {"PULL car1:speed hops=17", "'hops'"},
        {"PULL car1:speed must_sign=yes", "'must_sign'"},
        {"PULL car1:speed {}", "body"},
        {"BIND car1:speed {\"a\":1}", "body"},
        {"BIND car1:speed every=0", "'every'"},
        {"BIND car1:speed keep=65537", "'keep'"},
        {"BIND car1:speed lease=x", "'lease'"},
        {"PUSH car1:log reply=yes", "'reply'"},
        {"DELEGATE car1:work progress=no", "'progress'"},
        {"UPDATE car1:notice seq=1 {}", "'seq' and 'epoch'"},
        {"PULL \xC3\xA4:speed", "target"},
        {std::string("PULL car1:sp\0eed", 16), "task"},
        {"PULL car1:speed x=\x07", "'x="},
    };
    for (const auto& e : examples) {
        const auto reply = link.reply(e.line);
        BOOST_TEST(reply.error == "bad_request", e.line);
        BOOST_TEST(reply.message.find(e.says) != std::string::npos, e.line << " gives: " << reply.message);
        BOOST_TEST(reply.message.find("car1") != std::string::npos, e.line << " gives: " << reply.message);
    }
    BOOST_TEST(node.counts().errors == std::size(examples));
    BOOST_TEST(link.finishes == 0);
    BOOST_TEST(link.closes == 0);
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
}

BOOST_AUTO_TEST_CASE(the_reply_has_the_id_if_there_is_exactly_one_valid_id_before_the_body) {
    BOOST_TEST(link.kind("FLY car1:speed id=7") == "id=7 bad_request");
    BOOST_TEST(link.kind("PULL car1:speed deadline=0 id=7") == "id=7 bad_request");
    BOOST_TEST(link.kind("PULL car1:speed id=7 {}") == "id=7 bad_request");
    BOOST_TEST(link.kind("PULL car1:speed id=7 id=7") == "bad_request");
    BOOST_TEST(link.kind("PULL car1:speed id=7 id=8") == "bad_request");
    BOOST_TEST(link.kind("PULL car1:speed id=7 id=x") == "id=7 bad_request");
    BOOST_TEST(link.kind("PULL car1:speed id=0") == "bad_request");
    BOOST_TEST(link.kind("PUSH car1:log deadline=0 {\"x\": id=7 }") == "bad_request");
}

BOOST_AUTO_TEST_CASE(without_an_id_it_is_answered_in_order) {
    link.ask("DELEGATE car1:work");
    BOOST_TEST(link.ask("FLY car1:speed").empty());
    BOOST_TEST(link.ask("PULL car1:speed").empty());
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.sent() == "ok, bad_request, ok");
    BOOST_TEST(node.counts().errors == 1U);
}

BOOST_AUTO_TEST_CASE(with_an_id_it_is_answered_at_once) {
    link.ask("DELEGATE car1:work");
    BOOST_TEST(link.kind("FLY car1:speed id=7") == "id=7 bad_request");
}

BOOST_AUTO_TEST_CASE(a_malformed_line_whose_id_is_in_flight_closes_the_link) {
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.kind("FLY car1:speed id=7") == "id=7 bad_request");
    BOOST_TEST(link.finishes == 1);
    BOOST_TEST(node.started.at(0)->stopped);
    BOOST_TEST(link.ask("PULL car1:speed").empty());
}

BOOST_AUTO_TEST_CASE(reply_no_suppresses_the_error_of_a_malformed_push_or_update_and_it_is_counted) {
    for (const std::string_view line :
         {"PUSH car1:log reply=no deadline=0", "PUSH log reply=no", "UPDATE car1:notice reply=no nonsense",
          "PUSH car1:log nonsense reply=no id=7", "UPDATE car1:notice reply=no reply=no"}) {
        BOOST_TEST(link.ask(line).empty(), line);
    }
    BOOST_TEST(node.counts().errors_unsent == 5U);
    BOOST_TEST(node.counts().errors == 0U);
    BOOST_TEST(link.kind("PULL speed reply=no") == "bad_request"); // it has no effect on other verbs
}

BOOST_AUTO_TEST_CASE(a_flood_of_malformed_lines_while_a_request_runs_is_answered_one_by_one) {
    link.ask("DELEGATE car1:work");
    for (int i = 0; i < 1000; ++i) {
        BOOST_TEST(link.ask("FLY").empty());
    }
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.take_lines().size() == 1001U);
    BOOST_TEST(node.counts().errors == 1000U);
}

BOOST_AUTO_TEST_CASE(text_from_the_line_is_quoted_as_valid_json) {
    const auto answer = link.ask("PULL car1:speed \xFF\"\\");
    BOOST_TEST(cles::is_valid_json(answer));
    const auto cut = link.ask("PULL car1:speed " + std::string(46, 'x') + "\xC3\xA4\xC3\xA4"); // cut inside a character
    BOOST_TEST(cles::is_valid_json(cut));
}

BOOST_AUTO_TEST_SUITE_END()
