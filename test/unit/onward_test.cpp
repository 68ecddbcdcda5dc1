// SPDX-License-Identifier: BSL-1.0
#include "core/onward.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>

BOOST_AUTO_TEST_SUITE(onward)

namespace {

std::string adverbs(const std::string& line) {
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE_MESSAGE(cles::protocol::parse_request(line, r, wrong), wrong.why);
    return cles::core::onward_adverbs(r, "car1");
}

} // namespace

BOOST_AUTO_TEST_CASE(hops_are_one_less_and_this_node_is_the_last_in_via) {
    BOOST_TEST(adverbs("PULL car2:speed") == "hops=7 via=car1");
    BOOST_TEST(adverbs("PULL car2:speed via=car8,car9 hops=16") == "hops=15 via=car8,car9,car1");
    BOOST_TEST(adverbs("PULL car2:speed hops=0") == "hops=0 via=car1");
}

BOOST_AUTO_TEST_CASE(what_is_not_known_goes_with_it_and_what_is_known_does_not) {
    BOOST_TEST(adverbs("PUSH car2:log id=7 a=1 deadline=9 reply=no b=x=y {\"c\":2}") == "hops=7 via=car1 a=1 b=x=y");
}

BOOST_AUTO_TEST_CASE(on_another_verb_a_word_is_not_known) {
    BOOST_TEST(adverbs("PULL car2:speed keep=7 progress=yes seq=0") == "hops=7 via=car1 keep=7 progress=yes seq=0");
}

BOOST_AUTO_TEST_CASE(there_are_no_more_than_a_request_may_have) {
    std::string line = "PULL car2:speed";
    for (char c = 'a'; c < 'a' + 16; ++c) {
        line += std::string{" x"} + c + "=1";
    }
    const auto passed = adverbs(line);
    BOOST_TEST(std::count(passed.begin(), passed.end(), '=') == 2 + 10);
}

BOOST_AUTO_TEST_SUITE_END()
