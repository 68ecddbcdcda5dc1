// SPDX-License-Identifier: BSL-1.0
#include "isolation/wire_line.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

BOOST_AUTO_TEST_SUITE(wire_line)

using namespace cles::runtime;
using cles::verb;

BOOST_AUTO_TEST_CASE(a_request_is_a_line_of_the_language) {
    auto text = wire_line_writer{verb::delegate, "plan"}
                    .parameter("home base")
                    .parameter(std::uint64_t{7})
                    .adverb("id", std::int64_t{17})
                    .adverb("address", "unix:///run/a b")
                    .body(R"({"x":1})");
    BOOST_TEST(text == "DELEGATE self:plan/home%20base/7 id=17 address=unix%3A%2F%2F%2Frun%2Fa%20b {\"x\":1}\n");
    text.pop_back();
    const auto read = read_wire_line(text);
    BOOST_REQUIRE(read);
    BOOST_TEST(!read->is_reply);
    BOOST_TEST((read->verb == verb::delegate));
    BOOST_TEST(read->task == "plan");
    BOOST_REQUIRE(read->parameters.size() == 2);
    BOOST_TEST(read->parameters[0] == "home base");
    BOOST_TEST(read->number_at(1) == 7);
    BOOST_TEST(read->number_at(0) == 0);
    BOOST_TEST(read->number_at(2) == 0);
    BOOST_TEST(read->id == 17);
    BOOST_TEST(read->adverb("address") == "unix:///run/a b");
    BOOST_TEST(read->adverb("none").empty());
    BOOST_TEST(!read->number("address"));
    BOOST_TEST(read->body == R"({"x":1})");
}

BOOST_AUTO_TEST_CASE(any_bytes_survive_in_parameters_and_adverbs) {
    std::string bytes;
    for (int i = 1; i < 256; ++i) {
        bytes.push_back(static_cast<char>(i));
    }
    auto text = wire_line_writer{verb::pull, "t"}.parameter(bytes).adverb("key", bytes).body("{}");
    BOOST_TEST(text.find('\n') == text.size() - 1);
    text.pop_back();
    const auto read = read_wire_line(text);
    BOOST_REQUIRE(read);
    BOOST_TEST(read->parameters.at(0) == bytes);
    BOOST_TEST(read->adverb("key") == bytes);
}

BOOST_AUTO_TEST_CASE(replies_with_and_without_adverbs) {
    const auto text = wire_line_writer{9}.adverb("progress", "0.5").body("[1]");
    BOOST_TEST(text == "id=9 progress=0.5 [1]\n");
    const auto read = read_wire_line("id=9 progress=0.5 [1]");
    BOOST_REQUIRE(read);
    BOOST_TEST(read->is_reply);
    BOOST_TEST(read->id == 9);
    BOOST_TEST(read->adverb("progress") == "0.5");
    BOOST_TEST(read->body == "[1]");
}

BOOST_AUTO_TEST_CASE(malformed_lines_are_refused) {
    for (const std::string bad :
         {"", "nonsense", "PULL", "PULL self:", "PULL car1:speed", "FETCH self:speed", "PULL self:speed word",
          "PULL self:speed =1", "PULL self:speed id=0", "PULL self:speed id=x", "PULL self:speed/%4",
          "PULL self:speed/%zz", "PULL self:speed k=%", "id= {}", "id=99999999999999999999 {}", "id=-1 {}"}) {
        BOOST_TEST(!read_wire_line(bad), bad);
    }
}

BOOST_AUTO_TEST_CASE(bodies_of_replies) {
    BOOST_TEST(reply_body("") == "{}");
    BOOST_TEST(reply_body("7") == R"({"value":7})");
    BOOST_TEST(reply_body(R"("a")") == R"({"value":"a"})");
    BOOST_TEST(reply_body("[1]") == "[1]");
    BOOST_TEST(reply_body(R"({"a":1})") == R"({"a":1})");
}

BOOST_AUTO_TEST_CASE(failures) {
    BOOST_TEST(!read_failure("{}"));
    BOOST_TEST(!read_failure(R"({"a":1})"));
    const auto busy = read_failure(failure_body({"busy", "a \"full\" dock", 250}));
    BOOST_REQUIRE(busy);
    BOOST_TEST(busy->error == "busy");
    BOOST_TEST(busy->message == "a \"full\" dock");
    BOOST_TEST(busy->retry_ms.value() == 250);
    BOOST_TEST(!read_failure(failure_body({"failed", "x"}))->retry_ms);
    for (const std::string bad :
         {R"({"error":7})", R"({"error":"busy","retry_ms":"x"})", R"({"error":"busy")", R"({"error":"busy"} x)"}) {
        const auto read = read_failure(bad);
        BOOST_REQUIRE(read);
        BOOST_TEST(read->error == "failed");
    }
    BOOST_TEST(read_failure(R"({"error":"busy","retry_ms":-5})")->retry_ms.value() == 0);
}

BOOST_AUTO_TEST_SUITE_END()
