// SPDX-License-Identifier: BSL-1.0
#include "node/routing/deferred_request.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <string>

BOOST_AUTO_TEST_SUITE(aggregate_reply)

using namespace std::chrono_literals;
using cles::protocol::failure;

BOOST_AUTO_TEST_CASE(reply_of_no_nodes_is_empty) {
    BOOST_TEST(cles::core::aggregate_reply{}.whole() == R"({"results":{},"errors":{}})");
}

BOOST_AUTO_TEST_CASE(results_and_failures_are_separate) {
    cles::core::aggregate_reply answer;
    answer.add("car1", {.result = "{}"});
    answer.add("car2", {.failure = failure{.code = cles::errc::busy, .message = "full", .retry_ms = 7}});
    answer.add("car3", {.result = "[1]"});
    answer.add("car4", {.failure = failure{.answer = R"({"error":"new","x":1})"}});
    BOOST_TEST(answer.whole() == R"({"results":{"car1":{},"car3":[1]},"errors":{"car2":{"error":"busy",)"
                                 R"("message":"full","retry_ms":7},"car4":{"error":"new","x":1}}})");
}

BOOST_AUTO_TEST_CASE(what_another_pool_has_replied_is_added_with_its_name) {
    cles::core::aggregate_reply answer;
    answer.add("car1", {.result = "{}"});
    answer.add_pool("north",
                    {.result = R"({"results":{"car1":{"value":1},"car2":[2]},"errors":{"car3":{"error":"busy"}},)"
                               R"("more":{"x":1}})"});
    answer.add_pool("west", {.failure = failure{.code = cles::errc::no_target, .message = "no known node offers it"}});
    answer.add_pool("east", {.failure = failure{.code = cles::errc::unavailable, .message = "lost"}});
    answer.add_pool("late", {});
    BOOST_TEST(
        answer.whole() ==
        R"({"results":{"car1":{},"north.car1":{"value":1},"north.car2":[2]},"errors":{"north.car3":{"error":"busy"},)"
        R"("east.all":{"error":"unavailable","message":"lost"},)"
        R"("late.all":{"error":"deadline","message":"late.all did not answer in time"}}})");
}

BOOST_AUTO_TEST_CASE(what_is_no_name_in_the_reply_of_a_pool_is_left_out) {
    cles::core::aggregate_reply answer;
    answer.add_pool("north", {.result = R"({"results":{"a\"b":1,"car\n":2,"":3,"car1":4},"errors":{"x y":{}}})"});
    BOOST_TEST(answer.whole() == R"({"results":{"north.car1":4},"errors":{}})");
}

// Otherwise nobody could read the results of the others.
BOOST_AUTO_TEST_CASE(a_result_that_makes_the_reply_too_deep_is_an_error) {
    for (const std::size_t depth : {33U, 34U, 35U}) {
        const auto deep = std::string(depth, '[') + std::string(depth, ']');
        cles::core::aggregate_reply answer;
        answer.add("car1", {.result = deep});
        answer.add("car2", {.result = "{}"});
        answer.add("car3", {.failure = failure{.code = cles::errc::busy,
                                               .message = "full",
                                               .answer = R"({"error":"busy","x":)" + deep + "}"}});
        const auto text = answer.whole();
        BOOST_TEST(cles::detail::is_valid_answer(text), depth);
        BOOST_TEST((text.find(deep) != std::string::npos) == (depth == 33), text);
        BOOST_TEST((text.find("car1: the answer is nested too deeply") != std::string::npos) == (depth > 33), text);
        BOOST_TEST(text.find(R"("car3":{"error":"busy","message":"full")") != std::string::npos, text);
    }
}

BOOST_AUTO_TEST_CASE(pools_without_a_provider_add_nothing) {
    cles::core::aggregate_reply answer;
    answer.add_pool("west", {.failure = failure{.code = cles::errc::no_target, .message = "no known node offers it"}});
    BOOST_TEST(answer.is_empty());
}

BOOST_AUTO_TEST_CASE(is_sent_an_eighth_before_the_deadline_but_at_most_50_ms) {
    const cles::time_point now{1h};
    BOOST_TEST((cles::core::answer_by(now + 5s, now) == now + 4950ms));
    BOOST_TEST((cles::core::answer_by(now + 80ms, now) == now + 70ms));
}

BOOST_AUTO_TEST_SUITE_END()
