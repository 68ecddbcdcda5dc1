// SPDX-License-Identifier: BSL-1.0
#include "node/session/request_checks.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(failures)

using cles::errc;

BOOST_AUTO_TEST_CASE(a_missing_task_is_named) {
    const cles::test::test_node node;
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE(cles::protocol::parse_request("DELEGATE any:work/a", r, wrong));
    const auto why = no_such_task(*node.host, r);
    BOOST_TEST((why.code == errc::no_task));
    BOOST_TEST(why.message == "car1 has no DELEGATE 'work'");
}

BOOST_AUTO_TEST_CASE(too_large_names_the_limit) {
    const cles::test::test_node node;
    BOOST_TEST(overlong(*node.host, 0).message == "car1: a line has at most 1048576 bytes (limits.line)");
    BOOST_TEST(overlong(*node.host, 1200).message == "car1: a datagram has at most 1200 bytes: use TCP");
}

BOOST_AUTO_TEST_CASE(too_large_after_the_handler_ran_says_so) {
    BOOST_TEST(cles::core::after_run({.code = errc::too_large}).ran);
    BOOST_TEST(!cles::core::after_run({.code = errc::failed}).ran);
    BOOST_TEST(!cles::core::after_run({.code = errc::busy, .ran = true}).ran);
}

BOOST_AUTO_TEST_CASE(busy_has_a_retry_time) {
    BOOST_TEST(cles::core::failure_text(cles::core::busy("full")) ==
               R"({"error":"busy","message":"full","retry_ms":100})");
}

BOOST_AUTO_TEST_SUITE_END()
