// SPDX-License-Identifier: BSL-1.0
#include "node/routing/next_hop.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>

BOOST_AUTO_TEST_SUITE(next_hop)

namespace {

std::string adverbs(const std::string& line) {
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE_MESSAGE(cles::protocol::parse_request(line, r, wrong), wrong.why);
    return cles::core::forwarded_adverbs(r, "car1");
}

} // namespace

BOOST_AUTO_TEST_CASE(hops_are_one_less_and_this_node_is_the_last_in_via) {
    BOOST_TEST(adverbs("PULL car2:speed") == "hops=7 via=car1");
    BOOST_TEST(adverbs("PULL car2:speed via=car8,car9 hops=16") == "hops=15 via=car8,car9,car1");
    BOOST_TEST(adverbs("PULL car2:speed hops=0") == "hops=0 via=car1");
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_are_forwarded_and_known_ones_are_not) {
    BOOST_TEST(adverbs("PUSH car2:log id=7 a=1 deadline=9 reply=no b=x=y {\"c\":2}") == "hops=7 via=car1 a=1 b=x=y");
}

BOOST_AUTO_TEST_CASE(adverb_of_another_verb_is_unknown) {
    BOOST_TEST(adverbs("PULL car2:speed keep=7 progress=yes seq=0") == "hops=7 via=car1 keep=7 progress=yes seq=0");
}

BOOST_AUTO_TEST_CASE(number_of_adverbs_is_bounded) {
    std::string line = "PULL car2:speed";
    for (char c = 'a'; c < 'a' + 16; ++c) {
        line += std::string{" x"} + c + "=1";
    }
    const auto passed = adverbs(line);
    BOOST_TEST(std::count(passed.begin(), passed.end(), '=') == 2 + 10);
}

BOOST_AUTO_TEST_SUITE_END()
