// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

#include "platoon/drive/recording.hpp"
#include "platoon/simulation/outcome.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>

namespace recording {
namespace {

platoon::recording record_of(const platoon::assessment& judge) {
    platoon::recording drive{.vehicles = 2, .hz = 25};
    drive.verdict = judge.result();
    return drive;
}

} // namespace
} // namespace recording

BOOST_AUTO_TEST_SUITE(recording)

BOOST_AUTO_TEST_CASE(says_how_near_they_came) {
    platoon::assessment judge{2, 15, 5};
    judge.sample({{.x = 100}, {.x = 84}});
    judge.sample({{.x = 100}, {.x = 86}});
    const auto text = summary_of(record_of(judge));
    BOOST_TEST(text.find("spacing   1.000 m off at most, behind v0") != text.npos, text);
    BOOST_TEST(text.find("gap       9.000 m at least\n") != text.npos, text);
    judge.sample({{.x = 100}, {.x = 95}});
    BOOST_TEST(judge.result().collision);
    BOOST_TEST(summary_of(record_of(judge)).find("gap       0.000 m at least: A COLLISION\n") != text.npos);
}

BOOST_AUTO_TEST_CASE(claims_nothing_of_a_drive_that_nobody_saw) {
    const platoon::assessment judge{2, 15, 5};
    BOOST_TEST(!judge.result().collision);
    const auto text = summary_of(record_of(judge));
    BOOST_TEST(text.find("gap       unknown") != text.npos, text);
    BOOST_TEST(text.find("spacing") == text.npos, text);
    BOOST_TEST(cles::to_json(judge.result()).find(R"("least_gap":null)") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_drive_has_a_verdict_only_if_the_manoeuvre_ended) {
    platoon::verdict found{.string_ratio = 3};
    BOOST_TEST(exit_code_of(found, true) == 4);
    BOOST_TEST(exit_code_of(found, false) == 0); // it was about something else
    BOOST_TEST(!is_failure(found, true));
    found.ended = true;
    BOOST_TEST(exit_code_of(found, true) == 0);
    BOOST_TEST(is_failure(found, true));
    found.collision = true;
    BOOST_TEST(exit_code_of(found, true) == 1);
}

BOOST_AUTO_TEST_CASE(a_platoon_that_stands_or_is_apart_has_failed_unless_that_was_planned) {
    for (const bool stands : {false, true}) {
        const platoon::verdict found{.ended = true, .stands = stands, .apart = !stands};
        BOOST_TEST(exit_code_of(found, true) == 1);
        BOOST_TEST(is_failure(found, true));
        BOOST_TEST(exit_code_of(found, false) == 0);
        BOOST_TEST(!is_failure(found, false));
    }
}

BOOST_AUTO_TEST_CASE(one_alone_has_no_gap) {
    BOOST_TEST(std::isnan(platoon::least_gap({{.x = 3, .length = 5}})));
    BOOST_TEST(platoon::least_gap({{.x = 3, .length = 9}, {.x = 23, .length = 5}}) == 15);
}

BOOST_AUTO_TEST_SUITE_END()
