// SPDX-License-Identifier: BSL-1.0
#include "serve/command_outcome.hpp"

#include <boost/test/unit_test.hpp>

#include <csignal>
#include <optional>
#include <string>

namespace command_outcome {
namespace {

using cles::errc;

// As waitpid tells them.
int exited(int code) { return code << 8; }
int killed_by(int signal) { return signal; }

bool fails_with(int exit_code, errc wanted) { return tool::failure_of_exit(exit_code) == std::optional{wanted}; }

} // namespace
} // namespace command_outcome

BOOST_AUTO_TEST_SUITE(command_outcome)

BOOST_AUTO_TEST_CASE(an_exit_code_is_an_outcome) {
    BOOST_TEST(!tool::failure_of_exit(0).has_value());
    BOOST_TEST(fails_with(1, errc::failed));
    BOOST_TEST(fails_with(2, errc::bad_request));
    BOOST_TEST(fails_with(3, errc::no_task));
    BOOST_TEST(fails_with(4, errc::deadline));
    BOOST_TEST(fails_with(5, errc::failed));
    BOOST_TEST(fails_with(6, errc::busy));
    BOOST_TEST(fails_with(64, errc::bad_request));
    BOOST_TEST(fails_with(65, errc::bad_request));
    BOOST_TEST(fails_with(69, errc::unavailable));
    BOOST_TEST(fails_with(75, errc::busy));
    BOOST_TEST(fails_with(77, errc::denied));
    BOOST_TEST(fails_with(127, errc::failed));
    BOOST_TEST(fails_with(255, errc::failed));
}

BOOST_AUTO_TEST_CASE(what_was_printed_is_the_result) {
    const auto of = [](const char* printed) { return tool::outcome_of({.status = exited(0), .printed = printed}); };
    BOOST_TEST(of("").text == "{}");
    BOOST_TEST(of(" \n\n").text == "{}");
    BOOST_TEST(of("{\n  \"a\": [1, 2]\n}\n").text == R"({"a":[1,2]})");
    BOOST_TEST(of("27.5\n").text == "27.5");
    BOOST_TEST(!of("27.5\n").failure.has_value());
    const auto bad = of("hello\n");
    BOOST_TEST((bad.failure == std::optional{errc::failed}));
    BOOST_TEST(bad.text.starts_with("the command has printed something that is no JSON: "));
    BOOST_TEST((of("{}{}").failure == std::optional{errc::failed}));
}

BOOST_AUTO_TEST_CASE(the_first_line_is_the_message_of_a_failure) {
    const auto of = [](const char* printed) { return tool::outcome_of({.status = exited(6), .printed = printed}); };
    BOOST_TEST((of("").failure == std::optional{errc::busy}));
    BOOST_TEST(of("").text == "the command has ended with exit code 6");
    BOOST_TEST(of("\n the road is closed \nand more\n").text == "the road is closed");
    BOOST_TEST(of("a\x1b[31mb").text == "a\\u001b[31mb");
    const std::string long_line(1000, 'x');
    BOOST_TEST(of(long_line.c_str()).text == long_line.substr(0, 256));
    const auto split = of((std::string(255, 'x') + "ä").c_str()).text;
    BOOST_TEST(split == std::string(255, 'x'));
}

BOOST_AUTO_TEST_CASE(a_signal_and_too_much_output_are_failures) {
    const auto killed = tool::outcome_of({.status = killed_by(SIGKILL), .printed = "{}"});
    BOOST_TEST((killed.failure == std::optional{errc::failed}));
    BOOST_TEST(killed.text == "the command was ended by signal 9");
    const auto cut = tool::outcome_of({.status = killed_by(SIGKILL), .printed = "{}", .is_cut = true});
    BOOST_TEST((cut.failure == std::optional{errc::too_large}));
}

BOOST_AUTO_TEST_SUITE_END()
