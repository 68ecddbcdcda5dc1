// SPDX-License-Identifier: BSL-1.0
#include "jadc2/commander.hpp"
#include "jadc2/story.hpp"

#include <boost/test/unit_test.hpp>

using cles::errc;

namespace commander {
namespace {

jadc2::picture picture_of(std::vector<fmv::track> tracks) { return {.by = "sat1", .tracks = std::move(tracks)}; }

} // namespace
} // namespace commander

BOOST_AUTO_TEST_SUITE(commander)

BOOST_AUTO_TEST_CASE(the_oldest_that_is_in_sight_is_worth_it) {
    jadc2::commander c;
    BOOST_TEST(!c.select_target(10));
    c.set_picture(picture_of(
        {{.id = 1, .age = 9}, {.id = 2, .age = 12}, {.id = 3, .age = 50, .missed = 1}, {.id = 4, .age = 30}}));
    BOOST_TEST_REQUIRE(c.select_target(10).has_value());
    BOOST_TEST(c.select_target(10)->id == 4U);
    BOOST_TEST(!c.select_target(31));
}

BOOST_AUTO_TEST_CASE(against_one_target_there_is_one_order) {
    jadc2::commander c;
    c.set_picture(picture_of({{.id = 1, .age = 20}, {.id = 2, .age = 12}}));
    c.ordered(*c.select_target(10));
    BOOST_TEST_REQUIRE(c.select_target(10).has_value());
    BOOST_TEST(c.select_target(10)->id == 2U);
    c.ordered(*c.select_target(10));
    BOOST_TEST(!c.select_target(10));
    auto other = picture_of({{.id = 1, .age = 20}}); // the first target of another node is a different one
    other.by = "sat2";
    c.set_picture(other);
    BOOST_TEST(c.select_target(10).has_value());
}

BOOST_AUTO_TEST_CASE(what_others_attack_is_not_attacked) {
    jadc2::commander c;
    auto seen = picture_of({{.id = 1, .age = 20}, {.id = 2, .age = 12}});
    seen.engaged = std::vector<std::uint64_t>{1};
    c.set_picture(seen);
    BOOST_TEST_REQUIRE(c.select_target(10).has_value());
    BOOST_TEST(c.select_target(10)->id == 2U);
    BOOST_TEST(c.is_attacked({.id = 1}));
    BOOST_TEST(!c.is_attacked({.id = 2}));
    seen.engaged->push_back(2);
    c.set_picture(seen);
    BOOST_TEST(!c.select_target(10));
}

BOOST_AUTO_TEST_CASE(an_order_needs_a_picture_that_is_not_old) {
    jadc2::commander c;
    auto seen = picture_of({{.id = 1, .age = 20}});
    seen.captured = 100;
    c.set_picture(seen);
    const auto target = c.find(1).value();
    BOOST_TEST(c.objection(target, false, 102, 2) == "");
    BOOST_TEST(c.objection(target, true, 102.5, 2) == "the picture of target 1 is 2.5 s old: 2.0 at most");
    c.ordered(target);
    BOOST_TEST(c.objection(target, true, 102, 2) == "");
    BOOST_TEST(c.objection(target, false, 102, 2) ==
               "target 1 is under attack or hit: write strike 1 again, to attack it again");
}

BOOST_AUTO_TEST_CASE(a_target_is_found_by_its_number) {
    jadc2::commander c;
    c.set_picture(picture_of({{.id = 3, .lat = 7}}));
    BOOST_TEST_REQUIRE(c.find(3).has_value());
    BOOST_TEST(c.find(3)->lat == 7);
    BOOST_TEST(!c.find(4));
}

BOOST_AUTO_TEST_CASE(each_order_has_a_fate) {
    jadc2::commander c;
    for (const char* fate : {"done", "refused", "failed", "unknown", "done"}) {
        c.ordered({.id = 1});
        BOOST_TEST(c.fates().open == 1U);
        c.ended(fate);
    }
    BOOST_TEST(c.fates().open == 0U);
    BOOST_TEST(c.fates().given == 5U);
    BOOST_TEST(c.fates().done == 2U);
    BOOST_TEST(c.fates().refused == 1U);
    BOOST_TEST(c.fates().failed == 1U);
    BOOST_TEST(c.fates().unknown == 1U);
}

BOOST_AUTO_TEST_CASE(misses_count) {
    jadc2::commander c;
    BOOST_TEST(jadc2::exit_code_of(c.fates()) == 3); // none was given
    const auto give = [&c](const std::string& fate) {
        c.ordered({.id = 1});
        c.ended(fate);
    };
    give("done");
    c.assessed(true);
    BOOST_TEST(jadc2::exit_code_of(c.fates()) == 0);
    give("aborted");
    BOOST_TEST(jadc2::exit_code_of(c.fates()) == 3);
    give("done");
    c.assessed(false);
    BOOST_TEST(jadc2::exit_code_of(c.fates()) == 7);
    give("failed");
    BOOST_TEST(jadc2::exit_code_of(c.fates()) == 5);
    give("done");
    c.assessed(std::nullopt);
    BOOST_TEST(jadc2::exit_code_of(c.fates()) == 4);
    give("unknown");
    BOOST_TEST(jadc2::text_of(c.fates()) ==
               "6 orders: 3 released (1 hit, 1 missed, 1 not seen), 0 refused, 1 failed, 1 aborted, 1 unknown");
}

BOOST_AUTO_TEST_CASE(whether_it_was_carried_out_is_not_guessed) {
    for (const auto code : {errc::unavailable, errc::deadline, errc::stopped, errc::cancelled}) {
        BOOST_TEST(jadc2::fate_of({code, "w"}) == "unknown");
    }
    for (const auto code : {errc::busy, errc::no_target, errc::no_task, errc::denied}) {
        BOOST_TEST(jadc2::fate_of({code, "w"}) == "refused");
    }
    for (const auto code : {errc::failed, errc::bad_request}) {
        BOOST_TEST(jadc2::fate_of({code, "w"}) == "failed");
    }
    const auto no_way = boost::system::errc::make_error_code(boost::system::errc::connection_refused);
    BOOST_TEST(jadc2::fate_of({no_way, "w"}) == "refused");
}

BOOST_AUTO_TEST_CASE(the_steps_of_a_story_are_all_of_it) {
    const jadc2::picture seen{.by = "sat1",
                              .frame = 40,
                              .captured = 100,
                              .published = 100.012,
                              .encode_ms = 1,
                              .way_ms = 4,
                              .queue_ms = 2,
                              .run_ms = 3};
    const auto told = jadc2::begin_story(seen, {.id = 9}, 100.015, 100.016);
    BOOST_TEST(told.target == 9U);
    BOOST_TEST(told.publish_ms == 2, boost::test_tools::tolerance(1e-6));
    BOOST_TEST(told.tracks_way_ms == 3, boost::test_tools::tolerance(1e-6));
    BOOST_TEST(told.decide_ms == 1, boost::test_tools::tolerance(1e-6));
    BOOST_TEST(told.data_to_decision_ms == 16, boost::test_tools::tolerance(1e-6));
    const auto lines = jadc2::lines_of(told);
    BOOST_REQUIRE_EQUAL(lines.size(), 8U);
    BOOST_TEST(lines[3].starts_with("processed at sat1"), lines[3]);
    BOOST_TEST(lines.back().starts_with("data to decision"), lines.back()); // there is no answer
}

BOOST_AUTO_TEST_SUITE_END()
