// SPDX-License-Identifier: BSL-1.0
#include <cles/reply_operation.hpp>

#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <string>
#include <string_view>

namespace reply_types {

enum class light { red, green };
BOOST_DESCRIBE_ENUM(light, red, green)

struct pose {
    double x = 0;
};
BOOST_DESCRIBE_STRUCT(pose, (), (x))

} // namespace reply_types

namespace reply_operation {
namespace {

using cles::detail::pending;
using cles::detail::wrapped;

/// The outcome of reading a reply as a T: "malformed", "conversion: ...", or "read".
template <class T>
std::string read(std::string_view json, T& value) {
    boost::system::error_code code;
    std::string why;
    if (cles::detail::read_result(json, value, code, why) == pending::verdict::malformed) {
        return "malformed";
    }
    if (code == cles::errc::conversion) {
        return "conversion: " + why.substr(0, why.find(" (at byte"));
    }
    return code ? code.message() : "read";
}

template <class T>
std::string read(std::string_view json) {
    T value{};
    return read(json, value);
}

} // namespace
} // namespace reply_operation

BOOST_AUTO_TEST_SUITE(reply_operation)

BOOST_AUTO_TEST_CASE(a_scalar_result_comes_wrapped_as_value) {
    wrapped<int> number{};
    BOOST_TEST(read("{\"value\":5}", number) == "read");
    BOOST_TEST(number.value == 5);
    wrapped<std::string> text{};
    BOOST_TEST(read("{\"unit\":\"m\",\"value\":\"x\",\"more\":[1]}", text) == "read");
    BOOST_TEST(text.value == "x");
    wrapped<reply_types::light> colour{};
    BOOST_TEST(read("{\"value\":\"green\"}", colour) == "read");
    BOOST_TEST((colour.value == reply_types::light::green));
}

BOOST_AUTO_TEST_CASE(only_scalars_and_described_enums_are_wrapped) {
    using cles::detail::comes_wrapped;
    BOOST_TEST(comes_wrapped<bool>);
    BOOST_TEST(comes_wrapped<double>);
    BOOST_TEST(comes_wrapped<std::string>);
    BOOST_TEST(comes_wrapped<reply_types::light>);
    BOOST_TEST(!comes_wrapped<reply_types::pose>);
    BOOST_TEST(!comes_wrapped<cles::json_text>);
}

BOOST_AUTO_TEST_CASE(a_result_that_is_not_json_is_malformed) {
    for (const std::string_view bad : {"{\"value\":5", "{\"value\":5} x", "{value:5}", "[\"\xFF\"]", ""}) {
        BOOST_TEST(read<wrapped<int>>(bad) == "malformed", bad);
        BOOST_TEST(read<reply_types::pose>(bad) == "malformed", bad);
        BOOST_TEST(read<cles::json_text>(bad) == "malformed", bad);
    }
}

BOOST_AUTO_TEST_CASE(a_result_of_another_shape_is_a_failed_conversion_that_names_the_path) {
    BOOST_TEST(read<wrapped<int>>("{\"value\":\"x\"}") ==
               "conversion: the answer is invalid: value: expected a number, got a string");
    BOOST_TEST(read<wrapped<int>>("{}") == "conversion: the answer is invalid: value: is missing");
    BOOST_TEST(read<wrapped<int>>("[5]") == "conversion: the answer is invalid: expected an object, got an array");
    BOOST_TEST(read<reply_types::pose>("{\"x\":null}") == "read"); // the written form of a number that is not finite
    BOOST_TEST(read<reply_types::pose>("{\"x\":[]}") ==
               "conversion: the answer is invalid: x: expected a number, got an array");
}

BOOST_AUTO_TEST_CASE(json_text_is_returned_unchanged) {
    cles::json_text text;
    BOOST_TEST(read("{\"a\": [1, 2]}", text) == "read");
    BOOST_TEST(text.text == "{\"a\": [1, 2]}");
}

BOOST_AUTO_TEST_SUITE_END()
