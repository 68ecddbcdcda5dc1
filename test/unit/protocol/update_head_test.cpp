// SPDX-License-Identifier: BSL-1.0
#include "protocol/request_line.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <string>
#include <string_view>

namespace update_head {
namespace {

using cles::protocol::malformed_request;
using cles::protocol::request_line;
using remembered = cles::protocol::update_head;

constexpr std::string_view first = R"(UPDATE car1:place/a%20b seq=17 epoch=5f3a09c1 {"v":1})";

remembered remembering(std::string_view line) {
    request_line parsed;
    malformed_request error;
    BOOST_REQUIRE(cles::protocol::parse_request(line, parsed, error));
    remembered head;
    head.remember(line, parsed);
    return head;
}

} // namespace
} // namespace update_head

BOOST_AUTO_TEST_SUITE(update_head)

BOOST_AUTO_TEST_CASE(remembers_nothing_at_first) {
    remembered head;
    BOOST_TEST(head.recognise(first) == nullptr);
}

BOOST_AUTO_TEST_CASE(the_next_update_of_a_noun_equals_the_parsed_one) {
    auto head = remembering(std::string{first}); // the buffer is destroyed afterwards
    for (const std::string_view line :
         {R"(UPDATE car1:place/a%20b seq=18 epoch=5f3a09c1 {"v":2})",
          R"(UPDATE car1:place/a%20b seq=1 epoch=5f3a09c1 [])",
          R"(UPDATE car1:place/a%20b seq=999999999999999999 epoch=5f3a09c1 {"v": {"w":"}"}})"}) {
        request_line parsed;
        malformed_request error;
        BOOST_REQUIRE(cles::protocol::parse_request(line, parsed, error));
        const auto* known = head.recognise(line);
        BOOST_REQUIRE_MESSAGE(known != nullptr, line);
        BOOST_TEST(known->is_update());
        BOOST_TEST((known->seq == parsed.seq));
        BOOST_TEST((known->epoch == parsed.epoch));
        BOOST_TEST(known->noun.target == parsed.noun.target);
        BOOST_TEST(known->noun.path == parsed.noun.path);
        BOOST_TEST(known->body == parsed.body);
    }
}

BOOST_AUTO_TEST_CASE(lines_that_differ_in_more_than_their_number_are_left_to_the_parser) {
    auto head = remembering(first);
    for (const std::string_view line : {
             R"(UPDATE car1:place/a%20c seq=18 epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car2:place/a%20b seq=18 epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=18 epoch=5f3a09c2 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=18  epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=18 epoch=5f3a09c1)",
             R"(UPDATE car1:place/a%20b seq=18 epoch=5f3a09c1 )",
             R"(UPDATE car1:place/a%20b seq=18 epoch=5f3a09c1 x=1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq= epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=0 epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=018 epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=9223372036854775808 epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=-18 epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=18 epoch=5f3a09c1 {"v":2} HTTP/1.1)",
             R"(UPDATE car1:place/a%20b seq=18 epoch=5f3a09c1 {"v":2} )",
             R"( UPDATE car1:place/a%20b seq=18 epoch=5f3a09c1 {"v":2})",
             R"(UPDATE car1:place/a%20b seq=)",
             "",
         }) {
        BOOST_TEST(head.recognise(line) == nullptr, "'" << line << "'");
    }
}

BOOST_AUTO_TEST_CASE(only_the_form_that_nodes_write_is_kept) {
    const auto long_noun = [] {
        std::string noun = "UPDATE car1:place";
        for (int i = 0; i < 30; ++i) {
            noun += "/abcdefgh";
        }
        return noun + R"( seq=1 epoch=5f3a09c1 {"v":1})";
    }();
    const std::array<std::string_view, 6> others{
        R"(UPDATE car1:place epoch=5f3a09c1 seq=17 {"v":1})",
        R"(UPDATE car1:place seq=17 epoch=5f3a09c1 via=a {"v":1})",
        R"(UPDATE  car1:place seq=17 epoch=5f3a09c1 {"v":1})",
        R"(UPDATE car1:place id=3 seq=17 epoch=5f3a09c1 {"v":1})",
        R"(UPDATE car1:place {"v":" seq=1 epoch=5f3a09c1 {}"})",
        long_noun,
    };
    for (const auto line : others) {
        auto head = remembering(line);
        BOOST_TEST(head.recognise(line) == nullptr, "'" << line << "'");
    }
}

BOOST_AUTO_TEST_CASE(a_forgotten_head_is_not_recognised) {
    auto head = remembering(first);
    BOOST_TEST(head.recognise(first) != nullptr);
    head.forget();
    BOOST_TEST(head.recognise(first) == nullptr);
}

BOOST_AUTO_TEST_SUITE_END()
