// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/base/failure_copy.hpp"
#include "support/recorded_reply.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <utility>

namespace failure_copy {
namespace {

using verdict = cles::detail::pending::verdict;

struct fixture {
    /// An operation, which its owner ends.
    cles::detail::pending_ptr begin() {
        auto [operation, recorded] = cles::test::record();
        result = recorded;
        return cles::detail::pending_ptr{new cles::core::failure_copy{std::move(operation), copy}};
    }

    std::string copy = "untouched";
    std::shared_ptr<cles::test::outcome> result;
};

} // namespace
} // namespace failure_copy

BOOST_FIXTURE_TEST_SUITE(failure_copy, fixture)

BOOST_AUTO_TEST_CASE(what_the_peer_replies_is_copied_as_it_is) {
    const std::string answer = R"({"error":"busy","message":"later","ran":true,"retry_ms":20})";
    begin().release()->refuse(cles::errc::busy, "later", answer);
    BOOST_TEST(copy == answer);
    BOOST_TEST((result->code == cles::errc::busy));
    BOOST_TEST(result->text == "later");
}

BOOST_AUTO_TEST_CASE(other_ends_leave_it_alone) {
    begin().release()->fail(cles::errc::deadline, "too late");
    BOOST_TEST((result->code == cles::errc::deadline));
    BOOST_TEST((begin().release()->offer("{}") == verdict::completed));
    BOOST_TEST(result->text == "{}");
    begin(); // and is discarded
    BOOST_TEST(result->discarded);
    BOOST_TEST(copy == "untouched");
}

BOOST_AUTO_TEST_CASE(after_a_malformed_reply_it_goes_on_waiting) {
    auto operation = begin();
    BOOST_TEST((operation->offer("{") == verdict::malformed));
    BOOST_TEST(!result->ended);
    BOOST_TEST((operation.release()->offer("{}") == verdict::completed));
    BOOST_TEST(result->ended);
}

BOOST_AUTO_TEST_SUITE_END()
