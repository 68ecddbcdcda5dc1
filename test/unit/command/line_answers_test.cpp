// SPDX-License-Identifier: BSL-1.0
#include "client/line_answers.hpp"
#include "output/errors.hpp"

#include <boost/test/unit_test.hpp>

#include <exception>
#include <string>

namespace line_answers {
namespace {

std::string message_of(const std::exception_ptr& thrown) {
    try {
        std::rethrow_exception(thrown);
    } catch (const std::exception& e) {
        return e.what();
    }
}

} // namespace
} // namespace line_answers

BOOST_AUTO_TEST_SUITE(line_answers)

BOOST_AUTO_TEST_CASE(a_line_contains_a_body) {
    tool::line_answers answers;
    BOOST_TEST(answers.take(1, R"( {"a" : [1, 2]} )").value_or("") == R"({"a":[1,2]})");
    BOOST_TEST(answers.take(2, "[]\r").value_or("") == "[]");
    BOOST_TEST(answers.failure().empty());
    BOOST_TEST(!answers.first_failure());
}

BOOST_AUTO_TEST_CASE(a_line_that_contains_none_has_an_answer) {
    tool::line_answers answers;
    BOOST_TEST(!answers.take(3, R"({"a":)").has_value());
    BOOST_TEST(answers.failure().starts_with(R"({"error":"bad_request","message":"the body is not valid JSON: )"));
    BOOST_CHECK_THROW(std::rethrow_exception(answers.first_failure()), tool::usage_error);
    BOOST_TEST(message_of(answers.first_failure()).starts_with("line 3 of stdin: the body is not valid JSON: "));
    BOOST_TEST(!answers.take(4, "7").has_value());
    BOOST_TEST(answers.failure().find("an object or an array") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_failure_is_the_answer_of_its_line_only) {
    tool::line_answers answers;
    answers.take(1, "{}");
    answers.fail(cles::errc::busy, "it is \"full\"");
    BOOST_TEST(answers.failure() == R"({"error":"busy","message":"it is \"full\""})");
    answers.take(2, "{}");
    BOOST_TEST(answers.failure().empty());
}

BOOST_AUTO_TEST_CASE(the_first_failure_is_reported_at_the_end) {
    tool::line_answers answers;
    answers.take(1, "{}");
    answers.take(2, "{}");
    answers.fail(cles::errc::busy, "full");
    answers.take(3, "{}");
    answers.refuse("it does not fit");
    BOOST_TEST(answers.failure() == R"({"error":"bad_request","message":"it does not fit"})");
    BOOST_TEST(message_of(answers.first_failure()) == "busy: line 2 of stdin: full");
}

BOOST_AUTO_TEST_SUITE_END()
