// SPDX-License-Identifier: BSL-1.0
#include "jadc2/frame_fates.hpp"

#include <boost/test/unit_test.hpp>

using cles::errc;

BOOST_AUTO_TEST_SUITE(frame_fates)

BOOST_AUTO_TEST_CASE(the_node_that_took_the_first_is_asked_for_the_others) {
    jadc2::frame_fates all;
    BOOST_TEST(all.target() == "any");
    all.captured();
    BOOST_TEST(all.open());
    BOOST_TEST(all.done("sat1"));
    BOOST_TEST(!all.open());
    BOOST_TEST(all.target() == "sat1");
    all.captured();
    BOOST_TEST(!all.done("sat1"));
}

BOOST_AUTO_TEST_CASE(where_it_is_lost_any_is_asked) {
    const cles::error refused{boost::system::errc::make_error_code(boost::system::errc::connection_refused), "no way"};
    for (const auto& why : {cles::error{errc::unavailable, "w"}, cles::error{errc::deadline, "w"},
                            cles::error{errc::no_target, "w"}, cles::error{errc::no_task, "w"}, refused}) {
        jadc2::frame_fates all;
        all.captured();
        all.done("sat1");
        all.captured();
        BOOST_TEST(all.failed(why));
        BOOST_TEST(all.target() == "any");
        all.captured();
        BOOST_TEST(!all.failed(why)); // nothing new
        all.captured();
        BOOST_TEST(all.done("sat2"));
        BOOST_TEST(all.error().empty());
    }
}

BOOST_AUTO_TEST_CASE(one_that_is_busy_is_asked_again) {
    jadc2::frame_fates all;
    all.captured();
    all.done("sat1");
    for (const auto code : {errc::busy, errc::bad_request, errc::failed}) {
        all.captured();
        BOOST_TEST(all.failed({code, "w"}));
        BOOST_TEST(all.target() == "sat1");
    }
}

BOOST_AUTO_TEST_CASE(each_frame_has_a_fate) {
    jadc2::frame_fates all;
    all.captured();
    all.skipped();
    all.skipped();
    all.done("sat1");
    all.captured();
    all.failed({errc::busy, "w"});
    all.captured();
    all.failed({boost::system::errc::make_error_code(boost::system::errc::connection_refused), "no way"});
    const auto& sums = all.sums();
    BOOST_TEST(sums.captured == 5U);
    BOOST_TEST(sums.captured == sums.done + sums.failed + sums.skipped);
    BOOST_TEST(sums.failures.at("busy") == 1U);
    BOOST_TEST(sums.failures.at("unreachable") == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
