// SPDX-License-Identifier: BSL-1.0
#include "core/waiting_requests.hpp"

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

BOOST_AUTO_TEST_CASE(they_come_out_in_the_order_in_which_they_came_with_the_time_of_their_arrival) {
    cles::core::waiting_requests queue;
    queue.push_line("PULL a:b", start);
    queue.push_answer("{}", start + 1s);
    queue.push_line("PULL a:c", start + 2s);
    BOOST_TEST(queue.size() == 3U);
    BOOST_TEST(queue.bytes() == 18U);
    const auto first = queue.pop();
    BOOST_TEST(first.line == "PULL a:b");
    BOOST_TEST(first.answer.empty());
    BOOST_CHECK(first.arrived == start);
    BOOST_TEST(queue.pop().answer == "{}");
    BOOST_CHECK(queue.pop().arrived == start + 2s);
    BOOST_TEST(queue.empty());
    BOOST_TEST(queue.bytes() == 0U);
}

BOOST_AUTO_TEST_CASE(equal_answers_in_a_row_are_kept_as_one_and_counted_as_all) {
    cles::core::waiting_requests queue;
    for (int i = 0; i < 1000; ++i) {
        queue.push_answer("no", start);
    }
    queue.push_answer("yes", start);
    queue.push_answer("no", start);
    BOOST_TEST(queue.size() == 3U);
    BOOST_TEST(queue.bytes() == 2005U);
    BOOST_TEST(queue.pop().times == 1000U);
    BOOST_TEST(queue.bytes() == 5U);
    BOOST_TEST(queue.pop().times == 1U);
    BOOST_TEST(queue.pop().answer == "no");
}

BOOST_AUTO_TEST_CASE(clearing_leaves_nothing) {
    cles::core::waiting_requests queue;
    queue.push_line("PULL a:b", start);
    queue.push_answer("no", start);
    queue.clear();
    BOOST_TEST(queue.empty());
    BOOST_TEST(queue.bytes() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
