// SPDX-License-Identifier: BSL-1.0
#include "jadc2/operator_command.hpp"
#include "jadc2/order_desk.hpp"

#include <boost/test/unit_test.hpp>

#include <string_view>

BOOST_AUTO_TEST_SUITE(order_desk)

using word = jadc2::operator_command::word;

BOOST_AUTO_TEST_CASE(an_order_is_given_once_and_only_after_it_was_confirmed) {
    jadc2::order_desk desk;
    BOOST_TEST(!desk.confirm(100));
    BOOST_TEST(desk.read_back({.by = "sat1", .target = 7, .again = true}, 100));
    const auto given = desk.confirm(101);
    BOOST_TEST_REQUIRE(given.has_value());
    BOOST_TEST(given->by == "sat1");
    BOOST_TEST(given->target == 7U);
    BOOST_TEST(given->again);
    BOOST_TEST(!desk.confirm(101));
}

BOOST_AUTO_TEST_CASE(one_that_nobody_confirms_lapses_unless_it_is_held) {
    jadc2::order_desk desk;
    desk.read_back({.target = 7}, 100);
    BOOST_TEST(!desk.confirm(130));
    desk.read_back({.target = 8}, 200);
    BOOST_TEST(desk.hold(210));
    BOOST_TEST(!desk.read_back({.target = 9}, 220)); // the one that is held has to be decided on first
    BOOST_TEST(desk.confirm(1000).value().target == 8U);
    BOOST_TEST(desk.read_back({.target = 9}, 1001));
    BOOST_TEST(!desk.hold(1031)); // too late
}

BOOST_AUTO_TEST_CASE(one_that_is_aborted_is_gone) {
    jadc2::order_desk desk;
    BOOST_TEST(!desk.abort(100));
    desk.read_back({.target = 7}, 100);
    BOOST_TEST(desk.abort(101));
    BOOST_TEST(!desk.confirm(101));
    desk.read_back({.target = 8}, 102);
    desk.hold(103);
    BOOST_TEST(desk.abort(104));
    BOOST_TEST(desk.read_back({.target = 9}, 105));
}

BOOST_AUTO_TEST_CASE(what_an_operator_writes) {
    const auto strike = jadc2::parse_command("strike 12");
    BOOST_TEST((strike.what == word::strike));
    BOOST_TEST(strike.target == 12U);
    BOOST_TEST(!strike.again);
    const auto again = jadc2::parse_command("strike 12 again");
    BOOST_TEST((again.what == word::strike));
    BOOST_TEST(again.target == 12U);
    BOOST_TEST(again.again);
    BOOST_TEST((jadc2::parse_command("confirm").what == word::confirm));
    BOOST_TEST((jadc2::parse_command("hold").what == word::hold));
    BOOST_TEST((jadc2::parse_command("abort").what == word::abort));
    BOOST_TEST((jadc2::parse_command("quit").what == word::quit));
    for (const std::string_view wrong :
         {"", "strike", "strike ", "strike again", "strike  again", "strike x", "strike -1", "strike 1 2",
          "strike 1 again again", "Confirm", "confirm 1", "strike 99999999999999999999"}) {
        BOOST_TEST((jadc2::parse_command(wrong).what == word::wrong), wrong);
    }
}

BOOST_AUTO_TEST_SUITE_END()
