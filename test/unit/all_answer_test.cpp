// SPDX-License-Identifier: BSL-1.0
#include "core/all_answer.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

BOOST_AUTO_TEST_SUITE(all_answer)

using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(nobody_is_an_empty_answer) {
    BOOST_TEST(cles::core::all_answer{}.whole() == R"({"results":{},"errors":{}})");
}

BOOST_AUTO_TEST_CASE(results_and_failures_stand_apart) {
    cles::core::all_answer answer;
    answer.add_result("car1", "{}");
    answer.add_failure("car2", {.code = cles::errc::busy, .message = "full", .retry_ms = 7});
    answer.add_result("car3", "[1]");
    answer.add_failure("car4", {.answer = R"({"error":"new","x":1})"});
    BOOST_TEST(answer.whole() == R"({"results":{"car1":{},"car3":[1]},"errors":{"car2":{"error":"busy",)"
                                 R"("message":"full","retry_ms":7},"car4":{"error":"new","x":1}}})");
}

BOOST_AUTO_TEST_CASE(it_leaves_an_eighth_before_the_time_but_no_more_than_50_ms) {
    const cles::time_point now{1h};
    BOOST_TEST((cles::core::answer_by(now + 5s, now) == now + 4950ms));
    BOOST_TEST((cles::core::answer_by(now + 80ms, now) == now + 70ms));
}

BOOST_AUTO_TEST_SUITE_END()
