// SPDX-License-Identifier: BSL-1.0
#include "jadc2/video_session.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace video_session {
namespace {

using cles::errc;

struct fixture {
    void open() {
        BOOST_TEST(all.has_to_open(now));
        all.opened(now);
    }
    /// Takes so many frames, one each 40 ms.
    void film(int frames) {
        for (int i = 0; i < frames; ++i) {
            now += 0.04;
            all.captured(next++, now);
        }
    }
    void check_sums() const {
        const auto& sums = all.sums();
        BOOST_TEST(sums.captured == sums.done + sums.missing + sums.skipped);
    }

    double now = 100;
    std::uint64_t next = 0;
    jadc2::video_session all{1, 5};
};

} // namespace
} // namespace video_session

BOOST_FIXTURE_TEST_SUITE(video_session, fixture)

BOOST_AUTO_TEST_CASE(one_request_opens_it_and_each_frame_has_a_result) {
    open();
    BOOST_TEST(!all.has_to_open(now));
    BOOST_TEST(!all.is_processed());
    for (std::uint64_t i = 0; i < 10; ++i) {
        film(1);
        const auto seen = all.result("sat1", i);
        BOOST_TEST_REQUIRE(seen.has_value());
        BOOST_TEST(seen->begins == (i == 0));
        BOOST_TEST(seen->missing == 0U);
    }
    BOOST_TEST(all.is_processed());
    BOOST_TEST(all.node() == "sat1");
    BOOST_TEST(all.sums().nodes == (std::vector<std::string>{"sat1"}), boost::test_tools::per_element());
    all.ended();
    BOOST_TEST(all.sums().done == 10U);
    BOOST_TEST(all.sums().missing == 0U);
}

BOOST_AUTO_TEST_CASE(frames_before_a_result_are_missing_if_they_have_none) {
    open();
    film(5); // the node binds meanwhile
    const auto first = all.result("sat1", 3);
    BOOST_TEST(first->begins);
    BOOST_TEST(first->missing == 3U);
    BOOST_TEST(!all.result("sat1", 3).has_value()); // once
    BOOST_TEST(!all.result("sat1", 1).has_value()); // too late
    BOOST_TEST(!all.result("sat1", 99).has_value());
    film(3);
    const auto next_one = all.result("sat1", 6);
    BOOST_TEST(!next_one->begins);
    BOOST_TEST(next_one->missing == 2U);
    all.ended();
    BOOST_TEST(all.sums().missing == 6U);
    check_sums();
}

BOOST_AUTO_TEST_CASE(another_node_goes_on_with_the_next_frame_and_what_is_missing_is_told) {
    open();
    film(10);
    for (std::uint64_t i = 0; i < 7; ++i) {
        all.result("sat1", i);
    }
    BOOST_TEST(all.failed({errc::unavailable, "it is lost"}, now));
    BOOST_TEST(!all.is_open());
    BOOST_TEST(!all.result("sat1", 8).has_value()); // nobody waits for it any more
    film(2);
    BOOST_TEST(!all.has_to_open(now)); // not at once
    film(1);
    open();
    film(2);
    const auto seen = all.result("sat2", 14);
    BOOST_TEST_REQUIRE(seen.has_value());
    BOOST_TEST(seen->begins);
    BOOST_TEST(seen->missing == 7U); // 7 to 13
    BOOST_TEST(all.sums().nodes == (std::vector<std::string>{"sat1", "sat2"}), boost::test_tools::per_element());
    BOOST_TEST(all.sums().failures.at("unavailable") == 1U);
    all.ended();
    check_sums();
}

BOOST_AUTO_TEST_CASE(the_same_node_may_begin_again) {
    open();
    film(1);
    all.result("sat1", 0);
    all.failed({errc::failed, "it has failed"}, now);
    now += 1;
    open();
    film(1);
    BOOST_TEST(all.result("sat1", 1)->begins);
    BOOST_TEST(all.sums().nodes.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_reason_is_new_once) {
    for (int i = 0; i < 3; ++i) {
        open();
        BOOST_TEST(all.failed({errc::no_target, "nobody"}, now) == (i == 0));
        now += 1;
    }
    open();
    BOOST_TEST(all.failed({errc::busy, "too many"}, now));
    now += 1;
    open();
    film(1);
    all.result("sat1", 0);
    BOOST_TEST(all.failed({errc::busy, "too many"}, now)); // there was a result in between
    const cles::error refused{boost::system::errc::make_error_code(boost::system::errc::connection_refused), "no way"};
    now += 1;
    open();
    BOOST_TEST(all.failed(refused, now));
    BOOST_TEST(all.sums().failures.at("no_target") == 3U);
    BOOST_TEST(all.sums().failures.at("busy") == 2U);
    BOOST_TEST(all.sums().failures.at("unreachable") == 1U);
}

BOOST_AUTO_TEST_CASE(a_node_without_results_is_silent_and_no_node_is_not) {
    BOOST_TEST(!all.is_silent(now + 100));
    open();
    film(1);
    BOOST_TEST(!all.is_silent(now + 4.9)); // it may be looked for
    BOOST_TEST(all.is_silent(now + 5.1));
    all.result("sat1", 0);
    BOOST_TEST(!all.is_silent(now + 100)); // it has reported everything
    film(1);
    BOOST_TEST(!all.is_silent(now + 0.9));
    BOOST_TEST(all.is_silent(now + 1.1));
    now += 0.5;
    all.result("sat1", 1);
    film(1);
    BOOST_TEST(!all.is_silent(now + 0.9));
    all.failed({errc::deadline, "silent"}, now);
    BOOST_TEST(!all.is_silent(now + 100));
    now += 1;
    open();
    BOOST_TEST(!all.is_silent(now + 0.9));
    BOOST_TEST(all.is_silent(now + 1.1)); // nodes are known by now
}

BOOST_AUTO_TEST_CASE(frames_that_were_not_taken_are_counted) {
    open();
    film(2);
    all.skipped();
    next += 1;
    film(1);
    all.result("sat1", 1);
    BOOST_TEST(all.result("sat1", 3)->missing == 0U);
    all.ended();
    BOOST_TEST(all.sums().captured == 4U);
    BOOST_TEST(all.sums().skipped == 1U);
    BOOST_TEST(all.sums().missing == 1U);
    check_sums();
}

BOOST_AUTO_TEST_SUITE_END()
