// SPDX-License-Identifier: BSL-1.0
#include <cles/verb.hpp>

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <string>
#include <string_view>

namespace verb {
namespace {

using cles::to_string;
using word = cles::verb;

} // namespace
} // namespace verb

BOOST_AUTO_TEST_SUITE(verb)

BOOST_AUTO_TEST_CASE(the_five_verbs_are_written_in_capitals) {
    BOOST_TEST(cles::verb_count == 5U);
    BOOST_TEST(to_string(word::pull) == "PULL");
    BOOST_TEST(to_string(word::push) == "PUSH");
    BOOST_TEST(to_string(word::delegate) == "DELEGATE");
    BOOST_TEST(to_string(word::bind) == "BIND");
    BOOST_TEST(to_string(word::update) == "UPDATE");
}

BOOST_AUTO_TEST_CASE(a_verb_is_parsed_in_any_case) {
    for (const auto expected : {word::pull, word::push, word::delegate, word::bind, word::update}) {
        std::string text{to_string(expected)};
        BOOST_TEST((cles::verb_from(text) == expected), text);
        for (std::size_t i = 0; i < text.size(); i += 2) {
            text[i] = static_cast<char>(text[i] - 'A' + 'a');
        }
        BOOST_TEST((cles::verb_from(text) == expected), text);
    }
}

BOOST_AUTO_TEST_CASE(anything_else_is_not_a_verb) {
    for (const std::string_view bad :
         {"", "PUL", "PULLL", "GET", "pull ", " pull", "P\xC3\x9CSH", "PU1L", "0ULL", "pu[h"}) {
        BOOST_TEST(!cles::verb_from(bad).has_value(), bad);
    }
}

BOOST_AUTO_TEST_SUITE_END()
