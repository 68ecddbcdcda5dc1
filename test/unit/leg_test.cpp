// SPDX-License-Identifier: BSL-1.0
#include "core/leg.hpp"

#include <boost/asio/error.hpp>
#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>

BOOST_AUTO_TEST_SUITE(leg)

using cles::errc;

namespace {

struct told final : cles::core::leg_events {
    void on_result(std::size_t leg, std::string_view json) override {
        which = leg;
        result = json;
    }
    void on_failure(std::size_t leg, cles::core::leg_failure why) override {
        which = leg;
        failure = std::move(why);
        failed = true;
    }
    void on_progress(std::size_t, double, std::string_view) override {}

    std::size_t which = 0;
    std::string result;
    bool failed = false;
    cles::core::leg_failure failure;
};

struct fixture {
    std::shared_ptr<told> errand = std::make_shared<told>();
    cles::core::leg* one = new cles::core::leg(errand, 3);

    cles::core::leg_failure fails(boost::system::error_code code) {
        one->fail(code, "why");
        BOOST_TEST(errand->failed);
        return errand->failure;
    }
    cles::core::leg_failure refuses(const std::string& code, const std::string& more = {}) {
        const auto answer = R"({"error":")" + code + R"(","message":"car2: no")" + more + "}";
        one->refuse({}, {}, answer);
        BOOST_TEST(errand->failed);
        BOOST_TEST(errand->failure.told.answer == answer);
        return errand->failure;
    }
    void again() {
        errand = std::make_shared<told>();
        one = new cles::core::leg(errand, 3);
    }
};

} // namespace

BOOST_FIXTURE_TEST_CASE(a_result_is_told_and_to_whom, fixture) {
    BOOST_TEST((one->offer("{\"x\":1}") == cles::detail::pending::verdict::completed));
    BOOST_TEST(errand->result == "{\"x\":1}");
    BOOST_TEST(errand->which == 3U);
}

BOOST_FIXTURE_TEST_CASE(what_is_no_json_is_no_result, fixture) {
    BOOST_TEST((one->offer("{\"x\":") == cles::detail::pending::verdict::malformed));
    BOOST_TEST(errand->result.empty());
    one->discard();
}

BOOST_FIXTURE_TEST_CASE(who_was_never_reached_has_not_begun, fixture) {
    const auto why = fails(boost::asio::error::connection_refused);
    BOOST_TEST(why.unreachable);
    BOOST_TEST(!why.begun);
    BOOST_TEST((why.told.code == errc::unavailable));
    again();
    BOOST_TEST(fails(errc::no_target).unreachable);
    BOOST_TEST((errand->failure.told.code == errc::no_target));
}

BOOST_FIXTURE_TEST_CASE(who_was_lost_may_have_begun, fixture) {
    for (const auto code : {errc::unavailable, errc::stopped}) {
        const auto why = fails(code);
        BOOST_TEST(!why.unreachable);
        BOOST_TEST(why.begun);
        BOOST_TEST((why.told.code == errc::unavailable));
        again();
    }
    BOOST_TEST(fails(errc::deadline).begun);
    BOOST_TEST((errand->failure.told.code == errc::deadline));
}

BOOST_FIXTURE_TEST_CASE(a_request_that_is_too_large_to_be_sent_has_not_begun, fixture) {
    BOOST_TEST(!fails(errc::too_large).begun);
    BOOST_TEST(!errand->failure.unreachable);
}

BOOST_FIXTURE_TEST_CASE(a_request_for_which_this_node_has_no_memory_is_busy, fixture) {
    BOOST_TEST(!fails(errc::busy).begun);
    BOOST_TEST(!errand->failure.unreachable);
    BOOST_TEST((errand->failure.told.code == errc::busy));
}

BOOST_FIXTURE_TEST_CASE(who_refuses_has_not_begun_unless_it_says_so, fixture) {
    for (const std::string code : {"busy", "no_task", "no_target", "denied", "bad_request"}) {
        BOOST_TEST(!refuses(code).begun, code);
        again();
    }
    BOOST_TEST(refuses("busy", ",\"ran\":true").begun);
    for (const std::string code : {"failed", "unavailable", "deadline", "cancelled", "too_large", "from_the_future"}) {
        again();
        BOOST_TEST(refuses(code).begun, code);
    }
}

BOOST_AUTO_TEST_SUITE_END()
