// SPDX-License-Identifier: BSL-1.0
#include "node/routing/scatter_gather.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(aggregate_reply)

using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(reply_of_no_nodes_is_empty) {
    BOOST_TEST(cles::core::aggregate_reply{}.whole() == R"({"results":{},"errors":{}})");
}

BOOST_AUTO_TEST_CASE(results_and_failures_are_separate) {
    cles::core::aggregate_reply answer;
    answer.add_result("car1", "{}");
    answer.add_failure("car2", {.code = cles::errc::busy, .message = "full", .retry_ms = 7});
    answer.add_result("car3", "[1]");
    answer.add_failure("car4", {.answer = R"({"error":"new","x":1})"});
    BOOST_TEST(answer.whole() == R"({"results":{"car1":{},"car3":[1]},"errors":{"car2":{"error":"busy",)"
                                 R"("message":"full","retry_ms":7},"car4":{"error":"new","x":1}}})");
}

BOOST_AUTO_TEST_CASE(is_sent_an_eighth_before_the_deadline_but_at_most_50_ms) {
    const cles::time_point now{1h};
    BOOST_TEST((cles::core::answer_by(now + 5s, now) == now + 4950ms));
    BOOST_TEST((cles::core::answer_by(now + 80ms, now) == now + 70ms));
}

BOOST_AUTO_TEST_SUITE_END()
