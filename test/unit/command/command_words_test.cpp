// SPDX-License-Identifier: BSL-1.0
#include "output/errors.hpp"
#include "serve/command_words.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

namespace command_words {
namespace {

using words = std::vector<std::string>;

words of(const char* command) { return tool::words_of_command(command); }

} // namespace
} // namespace command_words

BOOST_AUTO_TEST_SUITE(command_words)

BOOST_AUTO_TEST_CASE(words_are_separated_by_blanks) {
    BOOST_TEST((of("date") == words{"date"}));
    BOOST_TEST((of("  ./plan.py\t--fast \n 7 ") == words{"./plan.py", "--fast", "7"}));
}

BOOST_AUTO_TEST_CASE(quotations_keep_blanks) {
    BOOST_TEST((of("jq -c '.lat + 1'") == words{"jq", "-c", ".lat + 1"}));
    BOOST_TEST((of("echo \"two words\"and'more of it'") == words{"echo", "two wordsandmore of it"}));
    BOOST_TEST((of("echo '' \"\"") == words{"echo", "", ""}));
    BOOST_TEST((of("echo 'a\"b' \"a'b\"") == words{"echo", "a\"b", "a'b"}));
}

BOOST_AUTO_TEST_CASE(a_backslash_keeps_the_next_character) {
    BOOST_TEST((of("echo a\\ b \\'c \"\\\"\"") == words{"echo", "a b", "'c", "\""}));
    BOOST_TEST((of("echo '\\'") == words{"echo", "\\"})); // as in a shell
    BOOST_TEST((of("echo \\") == words{"echo", "\\"}));
}

BOOST_AUTO_TEST_CASE(nothing_is_expanded) {
    BOOST_TEST((of("echo $HOME * `id` ; rm") == words{"echo", "$HOME", "*", "`id`", ";", "rm"}));
}

BOOST_AUTO_TEST_CASE(what_is_no_command_is_refused) {
    for (const auto* command : {"", "   ", "'' x", "echo 'x", "echo \"x"}) {
        BOOST_CHECK_THROW(of(command), tool::usage_error);
    }
}

BOOST_AUTO_TEST_SUITE_END()
