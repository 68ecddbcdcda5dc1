// SPDX-License-Identifier: BSL-1.0
#include "node/session/ordered_requests.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>

namespace ordered_requests {
namespace {

using namespace std::chrono_literals;
constexpr cles::time_point start{1h};

struct fixture {
    struct sink final : cles::test::recording_line_sink {};

    /// Serves those that wait, and calls `check` for each request.
    void serve(const std::function<void(const cles::protocol::request_line&, cles::time_point)>& check) {
        queue.serve([&](const cles::protocol::request_line& r, cles::time_point arrived) {
            ++served;
            check(r, arrived);
        });
    }

    cles::test::test_node node;
    sink out;
    cles::core::ordered_requests queue{*node.host, out, nullptr};
    int served = 0;
};

} // namespace
} // namespace ordered_requests

BOOST_FIXTURE_TEST_SUITE(ordered_requests, fixture)

BOOST_AUTO_TEST_CASE(they_keep_their_order_and_time_of_arrival) {
    queue.push("PULL a:b", start, false);
    queue.push_reply("{}");
    queue.push("PULL a:c", start + 2s, false);
    BOOST_TEST(queue.size() == 3U);
    BOOST_TEST(queue.bytes() == 18U);
    serve([&](const cles::protocol::request_line& r, cles::time_point arrived) {
        BOOST_TEST(r.text == (served == 1 ? "PULL a:b" : "PULL a:c"));
        BOOST_CHECK(arrived == (served == 1 ? start : start + 2s));
        BOOST_TEST(out.output() == (served == 1 ? "" : "{}\n"));
    });
    BOOST_TEST(served == 2);
    BOOST_TEST(!queue.must_wait());
    BOOST_TEST(queue.bytes() == 0U);
}

BOOST_AUTO_TEST_CASE(consecutive_equal_replies_are_stored_once_and_counted_in_full) {
    std::string expected;
    for (int i = 0; i < 1000; ++i) {
        queue.push_reply("no");
        expected += "no\n";
    }
    BOOST_TEST(queue.size() == 1U);
    BOOST_TEST(queue.bytes() == 2000U);
    queue.push("PULL a:b", start, false);
    queue.push_reply("yes");
    queue.push_reply("no");
    BOOST_TEST(queue.size() == 4U);
    BOOST_TEST(queue.bytes() == 2013U);
    serve([&](const cles::protocol::request_line&, cles::time_point) {
        BOOST_TEST((out.output() == expected));
        BOOST_TEST(queue.bytes() == 5U);
    });
    BOOST_TEST(served == 1);
    BOOST_TEST((out.take() == expected + "yes\nno\n"));
    BOOST_TEST(queue.bytes() == 0U);
}

BOOST_AUTO_TEST_CASE(clearing_leaves_nothing) {
    queue.push("PULL a:b", start, false);
    queue.push_reply("no");
    BOOST_TEST(queue.clear() == nullptr);
    BOOST_TEST(queue.size() == 0U);
    BOOST_TEST(queue.bytes() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
