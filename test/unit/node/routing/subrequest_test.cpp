// SPDX-License-Identifier: BSL-1.0
#include "node/routing/subrequest.hpp"

#include <boost/asio/error.hpp>
#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>

BOOST_AUTO_TEST_SUITE(subrequest)

using cles::errc;

namespace {

struct told {
    std::string result;
    bool failed = false;
    cles::core::subrequest_failure failure;
};

cles::core::subrequest* reporting_to(const std::shared_ptr<told>& to) {
    return new cles::core::subrequest([to](std::string_view json, const cles::core::subrequest_failure* why) {
        to->result = json;
        to->failed = why != nullptr;
        if (why != nullptr) {
            to->failure = *why;
        }
    });
}

struct fixture {
    std::shared_ptr<told> outcome = std::make_shared<told>();
    cles::core::subrequest* one = reporting_to(outcome);

    cles::core::subrequest_failure fails(boost::system::error_code code) {
        one->fail(code, "why");
        BOOST_TEST(outcome->failed);
        return outcome->failure;
    }
    cles::core::subrequest_failure refuses(const std::string& code, const std::string& more = {}) {
        const auto answer = R"({"error":")" + code + R"(","message":"car2: no")" + more + "}";
        one->refuse({}, {}, answer);
        BOOST_TEST(outcome->failed);
        BOOST_TEST(outcome->failure.reported.answer == answer);
        return outcome->failure;
    }
    void again() {
        outcome = std::make_shared<told>();
        one = reporting_to(outcome);
    }
};

} // namespace

BOOST_FIXTURE_TEST_CASE(result_is_reported, fixture) {
    BOOST_TEST((one->offer("{\"x\":1}") == cles::detail::pending::verdict::completed));
    BOOST_TEST(outcome->result == "{\"x\":1}");
    BOOST_TEST(!outcome->failed);
}

BOOST_FIXTURE_TEST_CASE(invalid_json_is_not_a_result, fixture) {
    BOOST_TEST((one->offer("{\"x\":") == cles::detail::pending::verdict::malformed));
    BOOST_TEST(outcome->result.empty());
    one->discard();
}

BOOST_FIXTURE_TEST_CASE(unreached_node_has_not_started, fixture) {
    const auto why = fails(boost::asio::error::connection_refused);
    BOOST_TEST(why.unreachable);
    BOOST_TEST(!why.may_have_started);
    BOOST_TEST((why.reported.code == errc::unavailable));
    again();
    BOOST_TEST(fails(errc::no_target).unreachable);
    BOOST_TEST((outcome->failure.reported.code == errc::no_target));
}

BOOST_FIXTURE_TEST_CASE(lost_node_may_have_started, fixture) {
    for (const auto code : {errc::unavailable, errc::stopped}) {
        const auto why = fails(code);
        BOOST_TEST(!why.unreachable);
        BOOST_TEST(why.may_have_started);
        BOOST_TEST((why.reported.code == errc::unavailable));
        again();
    }
    BOOST_TEST(fails(errc::deadline).may_have_started);
    BOOST_TEST((outcome->failure.reported.code == errc::deadline));
}

BOOST_FIXTURE_TEST_CASE(request_too_large_to_send_has_not_started, fixture) {
    BOOST_TEST(!fails(errc::too_large).may_have_started);
    BOOST_TEST(!outcome->failure.unreachable);
}

BOOST_FIXTURE_TEST_CASE(request_without_memory_on_this_node_is_busy, fixture) {
    BOOST_TEST(!fails(errc::busy).may_have_started);
    BOOST_TEST(!outcome->failure.unreachable);
    BOOST_TEST((outcome->failure.reported.code == errc::busy));
}

BOOST_FIXTURE_TEST_CASE(refusing_node_has_not_started_unless_it_says_so, fixture) {
    for (const std::string code : {"busy", "no_task", "no_target", "denied", "bad_request"}) {
        BOOST_TEST(!refuses(code).may_have_started, code);
        again();
    }
    BOOST_TEST(refuses("busy", ",\"ran\":true").may_have_started);
    for (const std::string code : {"failed", "unavailable", "deadline", "cancelled", "too_large", "from_the_future"}) {
        again();
        BOOST_TEST(refuses(code).may_have_started, code);
    }
}

BOOST_AUTO_TEST_SUITE_END()
