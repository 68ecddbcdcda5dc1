// SPDX-License-Identifier: BSL-1.0
#include "security/access/wildcard.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>

using namespace cles::security;

BOOST_AUTO_TEST_SUITE(wildcard)

BOOST_AUTO_TEST_CASE(a_wildcard_stands_for_any_characters) {
    struct row {
        std::string_view pattern, text;
        bool matches;
    };
    constexpr row table[] = {
        {"car1", "car1", true},   {"car1", "car10", false}, {"car1", "car", false},  {"", "", true},
        {"", "a", false},         {"*", "", true},          {"*", "anything", true}, {"car*", "car", true},
        {"car*", "car12", true},  {"car*", "ca", false},    {"*car", "mycar", true}, {"*car", "cars", false},
        {"a*b", "ab", true},      {"a*b", "axxb", true},    {"a*b", "axxbx", false}, {"a*b", "a", false},
        {"a*a", "a", false},      {"a*a", "aa", true},      {"*a*", "bab", true},    {"*a*", "bbb", false},
        {"a*b*c", "abc", true},   {"a*b*c", "acbc", true},  {"a*b*c", "acb", false}, {"*ab*ab*", "ab", false},
        {"*ab*ab", "abab", true}, {"*ab*b", "abb", true},   {"*aab", "aaaab", true}, {"*aba*aba*", "ababa", false},
        {"*x", "xyx", true},      {"x*x*x", "xx", false},   {"Car*", "car1", false}, {"a*", "a\nb", true},
        {"**", "a", true},        {"a**b", "ab", true},     {"a**b", "a", false},
    };
    for (const auto& each : table) {
        BOOST_TEST(matches_wildcard(each.pattern, each.text, '*') == each.matches, each.pattern << " " << each.text);
    }
}

BOOST_AUTO_TEST_CASE(only_the_given_character_is_a_wildcard) {
    BOOST_TEST(matches_wildcard("a\x01z", "abz", '\x01'));
    BOOST_TEST(!matches_wildcard("a*z", "abz", '\x01'));
    BOOST_TEST(matches_wildcard("a*z", "a*z", '\x01'));
}

BOOST_AUTO_TEST_CASE(a_pattern_that_almost_fits_takes_no_longer) {
    // A matcher that goes back takes longer than the universe has existed, or minutes for a quadratic one.
    std::string pattern;
    for (int i = 0; i < 1000; ++i) {
        pattern.append("*a");
    }
    const std::string almost(1'000'000, 'a');
    const auto before = std::chrono::steady_clock::now();
    BOOST_TEST(!matches_wildcard(pattern + "*b", almost, '*'));
    BOOST_TEST(!matches_wildcard("*" + std::string(500'000, 'a') + "b*", almost, '*'));
    BOOST_TEST(matches_wildcard(pattern + "*", almost, '*'));
    BOOST_TEST((std::chrono::steady_clock::now() - before < std::chrono::seconds{5}));
}

BOOST_AUTO_TEST_CASE(patterns_of_names) {
    for (const auto* const valid : {"car1", "*", "car*", "*1", "a*b*c", "x_-.Y", "*a*", "self"}) {
        BOOST_TEST(is_name_pattern(valid), valid);
    }
    for (const auto* const other : {"", "**", "a**", "a b", " a", "a ", "a/b", "a:b", "a%41", "*~*", "a\n", "ä", "?"}) {
        BOOST_TEST(!is_name_pattern(other), other);
    }
    BOOST_TEST(!is_name_pattern(std::string_view{"a\0b", 3}));
    BOOST_TEST(is_name_pattern(std::string(64, 'a')));
    BOOST_TEST(!is_name_pattern(std::string(65, 'a')));
}

BOOST_AUTO_TEST_SUITE_END()
