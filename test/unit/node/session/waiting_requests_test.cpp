// SPDX-License-Identifier: BSL-1.0
#include "node/session/ordered_requests.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>

namespace waiting_requests {
namespace {

using namespace std::chrono_literals;
constexpr cles::time_point start{1h};

} // namespace
} // namespace waiting_requests

BOOST_AUTO_TEST_SUITE(waiting_requests)

BOOST_AUTO_TEST_CASE(they_keep_their_order_and_time_of_arrival) {
    cles::core::waiting_requests queue;
    queue.push_line("PULL a:b", start);
    queue.push_reply("{}", start + 1s);
    queue.push_line("PULL a:c", start + 2s);
    BOOST_TEST(queue.size() == 3U);
    BOOST_TEST(queue.bytes() == 18U);
    const auto first = queue.pop();
    BOOST_TEST(first.line == "PULL a:b");
    BOOST_TEST(first.reply.empty());
    BOOST_CHECK(first.arrived == start);
    BOOST_TEST(queue.pop().reply == "{}");
    BOOST_CHECK(queue.pop().arrived == start + 2s);
    BOOST_TEST(queue.empty());
    BOOST_TEST(queue.bytes() == 0U);
}

BOOST_AUTO_TEST_CASE(consecutive_equal_replies_are_stored_once_and_counted_in_full) {
    cles::core::waiting_requests queue;
    for (int i = 0; i < 1000; ++i) {
        queue.push_reply("no", start);
    }
    queue.push_reply("yes", start);
    queue.push_reply("no", start);
    BOOST_TEST(queue.size() == 3U);
    BOOST_TEST(queue.bytes() == 2005U);
    BOOST_TEST(queue.pop().times == 1000U);
    BOOST_TEST(queue.bytes() == 5U);
    BOOST_TEST(queue.pop().times == 1U);
    BOOST_TEST(queue.pop().reply == "no");
}

BOOST_AUTO_TEST_CASE(clearing_leaves_nothing) {
    cles::core::waiting_requests queue;
    queue.push_line("PULL a:b", start);
    queue.push_reply("no", start);
    queue.clear();
    BOOST_TEST(queue.empty());
    BOOST_TEST(queue.bytes() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
