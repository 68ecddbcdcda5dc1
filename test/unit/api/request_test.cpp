// SPDX-License-Identifier: BSL-1.0
#include <cles/request.hpp>

#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace request_types {

struct pose {
    double x = 0;
    std::vector<int> path;
};
BOOST_DESCRIBE_STRUCT(pose, (), (x, path))

} // namespace request_types

namespace request {
namespace {

/// What a request borrows, as long as a test keeps it.
struct source {
    std::string node = "car1";
    std::string task = "plan";
    std::vector<std::string> texts{"12", "-3", "0.5", "a b", "", "300"};
    std::vector<std::string_view> parameters{texts.begin(), texts.end()};
    std::string body = "{\"x\":1.5,\"path\":[1,2]}";
    cles::identity peer{.transport = "tcp", .address = "tcp://10.0.0.2:7", .name = {}, .uid = {}};
    cles::detail::request_data data{.verb = cles::verb::push,
                                    .node = node,
                                    .task = task,
                                    .parameters = parameters,
                                    .body = body,
                                    .peer = &peer,
                                    .deadline = cles::time_point{std::chrono::seconds{5}}};
    cles::request request{data};
};

bool says(const cles::error& e, std::string_view words) {
    return e.code() == cles::errc::bad_request && e.message().find(words) != std::string::npos;
}

} // namespace
} // namespace request

BOOST_FIXTURE_TEST_SUITE(request, source)

BOOST_AUTO_TEST_CASE(a_handler_sees_everything_on_the_line) {
    BOOST_TEST((request.verb() == cles::verb::push));
    BOOST_TEST(request.node() == "car1");
    BOOST_TEST(request.task() == "plan");
    BOOST_TEST(request.parameters().size() == 6U);
    BOOST_TEST(request.body() == body);
    BOOST_TEST(request.peer().address == "tcp://10.0.0.2:7");
    BOOST_CHECK(request.deadline() == cles::time_point{std::chrono::seconds{5}});
}

BOOST_AUTO_TEST_CASE(a_parameter_is_read_as_text_or_as_a_number) {
    const auto& r = request;
    BOOST_TEST(r.parameter(3) == "a b");
    BOOST_TEST(r.parameter<std::string>(0) == "12");
    BOOST_TEST(r.parameter<int>(0) == 12);
    BOOST_TEST(r.parameter<int>(1) == -3);
    BOOST_TEST(r.parameter<double>(2) == 0.5);
}

BOOST_AUTO_TEST_CASE(a_missing_or_invalid_parameter_is_bad_request_with_its_position) {
    const auto& r = request;
    const auto missing = [](const cles::error& e) { return says(e, "parameter 7 is missing"); };
    const auto no_number = [](const cles::error& e) { return says(e, "is not a valid number"); };
    BOOST_CHECK_EXCEPTION(static_cast<void>(r.parameter(6)), cles::error, missing);
    BOOST_CHECK_EXCEPTION(static_cast<void>(r.parameter<int>(6)), cles::error, missing);
    BOOST_CHECK_EXCEPTION(static_cast<void>(r.parameter<int>(2)), cles::error, no_number);
    BOOST_CHECK_EXCEPTION(static_cast<void>(r.parameter<int>(3)), cles::error, no_number);
    BOOST_CHECK_EXCEPTION(static_cast<void>(r.parameter<int>(4)), cles::error, no_number);
    BOOST_CHECK_EXCEPTION(static_cast<void>(r.parameter<unsigned>(1)), cles::error, no_number);
    BOOST_CHECK_EXCEPTION(static_cast<void>(r.parameter<std::uint8_t>(5)), cles::error, no_number);
}

BOOST_AUTO_TEST_CASE(a_parameter_that_is_no_finite_number_is_bad_request) {
    const std::vector<std::string_view> words{"inf", "-inf", "nan", "1e39"};
    data.parameters = words;
    const auto no_number = [](const cles::error& e) { return says(e, "is not a valid number"); };
    for (std::size_t i = 0; i < words.size(); ++i) {
        BOOST_CHECK_EXCEPTION(static_cast<void>(request.parameter<float>(i)), cles::error, no_number);
    }
    BOOST_CHECK_EXCEPTION(static_cast<void>(request.parameter<double>(0)), cles::error, no_number);
    BOOST_TEST(request.parameter<double>(3) == 1e39);
}

BOOST_AUTO_TEST_CASE(a_body_that_does_not_fit_its_type_is_bad_request_with_the_path) {
    using request_types::pose;
    BOOST_TEST(request.as<pose>().path.at(1) == 2);
    data.body = "{\"x\":1,\"path\":[1,\"b\"]}";
    BOOST_CHECK_EXCEPTION(static_cast<void>(request.as<pose>()), cles::error,
                          [](const cles::error& e) { return says(e, "path[1]: expected a number, got a string"); });
}

BOOST_AUTO_TEST_CASE(a_copy_owns_its_text) {
    std::optional<cles::request> kept;
    {
        source brief;
        kept.emplace(brief.request);
    }
    BOOST_TEST(kept->node() == "car1");
    BOOST_TEST(kept->task() == "plan");
    BOOST_TEST(kept->parameter(3) == "a b");
    BOOST_TEST(kept->parameter(4).empty());
    BOOST_TEST(kept->body() == "{\"x\":1.5,\"path\":[1,2]}");
    BOOST_TEST(kept->peer().address == "tcp://10.0.0.2:7");
    const cles::request moved{std::move(*kept)};
    kept.reset();
    BOOST_TEST(moved.parameter(0) == "12");
}

BOOST_AUTO_TEST_CASE(copies_of_a_copy_share_its_text) {
    const cles::request first{request};
    const cles::request second{first};
    cles::request third{request};
    third = second;
    BOOST_TEST((second.body().data() == first.body().data()));
    BOOST_TEST((third.body().data() == first.body().data()));
    BOOST_TEST((first.body().data() != request.body().data()));
}

BOOST_AUTO_TEST_SUITE_END()
