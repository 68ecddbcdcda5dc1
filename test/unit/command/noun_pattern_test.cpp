// SPDX-License-Identifier: BSL-1.0
#include "options/noun_pattern.hpp"
#include "output/errors.hpp"

#include <boost/test/unit_test.hpp>

namespace noun_pattern {
namespace {

bool matches(const char* pattern, const char* path) { return tool::noun_pattern{pattern}.matches_path(path); }

} // namespace
} // namespace noun_pattern

BOOST_AUTO_TEST_SUITE(noun_pattern)

BOOST_AUTO_TEST_CASE(a_noun_stands_for_itself) {
    const tool::noun_pattern noun{"car1:tyre/front"};
    BOOST_TEST(noun.is_noun());
    BOOST_TEST(!noun.is_of_many_nodes());
    BOOST_TEST(noun.target() == "car1");
    BOOST_TEST(noun.matches_node("car1"));
    BOOST_TEST(!noun.matches_node("car10"));
    BOOST_TEST(noun.matches_path("tyre/front"));
    BOOST_TEST(!noun.matches_path("tyre"));
    BOOST_TEST(!noun.matches_path("tyre/front/left"));
    BOOST_TEST(!tool::noun_pattern{"all:speed"}.is_of_many_nodes()); // it is bound as `all`
}

BOOST_AUTO_TEST_CASE(a_star_stands_for_characters_of_one_part) {
    BOOST_TEST(matches("car1:loc*", "localization"));
    BOOST_TEST(matches("car1:loc*", "loc"));
    BOOST_TEST(!matches("car1:loc*", "velocity"));
    BOOST_TEST(!matches("car1:loc*", "localization/fast"));
    BOOST_TEST(matches("car1:*", "speed"));
    BOOST_TEST(!matches("car1:*", "tyre/front"));
    BOOST_TEST(matches("car1:tyre/*", "tyre/front"));
    BOOST_TEST(!matches("car1:tyre/*", "tyre"));
    BOOST_TEST(matches("car1:*/front", "tyre/front"));
    BOOST_TEST(matches("car1:a*b*c", "aXbXbc"));
    BOOST_TEST(matches("car1:a*b*c", "abc"));
    BOOST_TEST(!matches("car1:a*b*c", "acb"));
    BOOST_TEST(!matches("car1:ab*ba", "aba")); // the same character twice
}

BOOST_AUTO_TEST_CASE(two_stars_stand_for_all_that_follows) {
    for (const auto* path : {"speed", "tyre/front", "a/b/c"}) {
        BOOST_TEST(matches("car1:**", path));
    }
    BOOST_TEST(matches("car1:tyre/**", "tyre"));
    BOOST_TEST(matches("car1:tyre/**", "tyre/front"));
    BOOST_TEST(matches("car1:tyre/**", "tyre/front/left"));
    BOOST_TEST(!matches("car1:tyre/**", "tyres"));
    BOOST_TEST(matches("car1:t*/**", "tyres/front"));
}

BOOST_AUTO_TEST_CASE(nodes_match_by_their_names) {
    const tool::noun_pattern cars{"car*:speed"};
    BOOST_TEST(cars.is_of_many_nodes());
    BOOST_TEST(cars.matches_node("car1"));
    BOOST_TEST(!cars.matches_node("truck1"));
    const tool::noun_pattern everything{"all:**"};
    BOOST_TEST(everything.is_of_many_nodes());
    BOOST_TEST(everything.matches_node("car1"));
    const tool::noun_pattern own{"self:**"};
    BOOST_TEST(!own.is_of_many_nodes());
    BOOST_TEST(!own.is_noun());
}

BOOST_AUTO_TEST_CASE(parameters_are_compared_decoded) {
    BOOST_TEST(matches("car1:a/b%20c", "a/b%20c"));
    BOOST_TEST(matches("car1:a/%62", "a/b"));
    BOOST_TEST(matches("car1:a/*%20*", "a/b%20c"));
    BOOST_TEST(matches("car1:a/%2A*", "a/%2Ab"));
    BOOST_TEST(!matches("car1:a/%2A*", "a/b"));
    BOOST_TEST(!matches("car1:a/b*", "a/%zz")); // as nobody tells it
}

BOOST_AUTO_TEST_CASE(what_is_neither_is_refused) {
    for (const auto* text : {"car1", "car1:", ":*", "car1:a b*", "car1:*/", "car1:a/%2*", "car1:**/a", "car1:a**",
                             "car1:a**/b", "**:a", "car1:a/***"}) {
        BOOST_CHECK_THROW(tool::noun_pattern{text}, tool::usage_error);
    }
}

BOOST_AUTO_TEST_SUITE_END()
