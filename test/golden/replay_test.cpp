// SPDX-License-Identifier: BSL-1.0
// The judge of the transcripts, judged: it finds what differs, and nothing else.
#include "replay.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

namespace replay {
namespace {

/// The problems of a script, one line each.
std::string problems(std::string_view script) {
    std::string all;
    for (const auto& problem : cles::test::replay(script)) {
        all += problem + "\n";
    }
    return all;
}

} // namespace
} // namespace replay

BOOST_AUTO_TEST_SUITE(replay)

BOOST_AUTO_TEST_CASE(what_comes_as_expected_is_no_problem) {
    BOOST_TEST(
        problems("# a comment\n\n> PULL car1:speed\n< {\"v\":27.5}\n> PULL car1:secret\n< {\"error\":\"denied\"...}\n"
                 "b> PULL car1:speed id=7\nb< id=7 {\"v\":27.5}\n")
            .empty());
}

BOOST_AUTO_TEST_CASE(what_differs_is_said) {
    BOOST_TEST(problems("> PULL car1:speed\n< {\"v\":3}\n") ==
               "line 2: expected '< {\"v\":3}', there came '< {\"v\":27.5}'\n");
}

BOOST_AUTO_TEST_CASE(what_does_not_come_is_said) {
    BOOST_TEST(problems("> PUSH car1:echo reply=no\n< {}\n") == "line 2: expected '< {}', nothing came\n");
}

BOOST_AUTO_TEST_CASE(what_nobody_expected_is_said) {
    BOOST_TEST(problems("> PULL car1:speed\n> PULL car1:number\n< {\"value\":42}\n") ==
               "line 2: nobody expected '< {\"v\":27.5}'\n");
    BOOST_TEST(problems("> PULL car1:speed\n< {\"v\":27.5}\n@ end\n") == "line 3: nobody expected '= finish'\n");
}

BOOST_AUTO_TEST_CASE(the_link_counts) {
    BOOST_TEST(problems("b> PULL car1:speed\n< {\"v\":27.5}\n") ==
               "line 2: expected '< {\"v\":27.5}', there came 'b< {\"v\":27.5}'\n");
}

BOOST_AUTO_TEST_CASE(a_script_that_makes_no_sense_is_no_success) {
    BOOST_TEST(problems("") == "line 0: nothing happens\n");
    BOOST_TEST(problems("PULL car1:speed\n") ==
               "line 1: neither a step, nor an expectation, nor a comment\nline 1: nothing happens\n");
    BOOST_TEST(problems("@ dance\n") == "line 1: there is no step '@ dance'\n");
    BOOST_TEST(problems("@ done lunch {}\n") == "line 1: no handler of 'lunch' runs\n");
    BOOST_TEST(problems("@ pass long\n") == "line 1: 'long' is no number from 0 to 100000000\n");
}

BOOST_AUTO_TEST_CASE(three_dots_stand_for_anything) {
    using cles::test::fits;
    BOOST_TEST(fits("abc", "abc"));
    BOOST_TEST(!fits("abc", "abcd"));
    BOOST_TEST(fits("a...", "a"));
    BOOST_TEST(fits("a...c", "a b c"));
    BOOST_TEST(fits("...b...", "abc"));
    BOOST_TEST(!fits("a...c", "abcd"));
    BOOST_TEST(!fits("a...b...c", "acb"));
    BOOST_TEST(!fits("ab...bc", "abc"));
}

BOOST_AUTO_TEST_SUITE_END()
