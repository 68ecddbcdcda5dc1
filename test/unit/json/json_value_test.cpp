// SPDX-License-Identifier: BSL-1.0
#include <cles/json_value.hpp>

#include <boost/json/array.hpp>
#include <boost/json/object.hpp>
#include <boost/json/parse.hpp>
#include <boost/json/value.hpp>
#include <boost/test/unit_test.hpp>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace json_value {
namespace {

using boost::json::value;

std::string why(std::string_view text) {
    value v;
    std::string message;
    return cles::from_json(text, v, &message) ? "(read)" : message.substr(0, message.find(" (at byte"));
}

} // namespace
} // namespace json_value

BOOST_AUTO_TEST_SUITE(json_value)

BOOST_AUTO_TEST_CASE(a_tree_is_read_and_written) {
    const std::string text =
        "{\"a\":[1,-2,18446744073709551615,0.5,true,false,null,\"x\\ny\"],\"b\":{\"c\":{}},\"d\":[]}";
    const auto tree = cles::from_json<value>(text);
    BOOST_TEST((tree == boost::json::parse(text)));
    BOOST_TEST(cles::to_json(tree) == text);
}

BOOST_AUTO_TEST_CASE(numbers_keep_their_kind) {
    BOOST_TEST(cles::from_json<value>("5").is_int64());
    BOOST_TEST(cles::from_json<value>("-9223372036854775808").as_int64() == std::numeric_limits<std::int64_t>::min());
    BOOST_TEST(cles::from_json<value>("9223372036854775808").is_uint64());
    BOOST_TEST(cles::from_json<value>("5.0").is_double());
    BOOST_TEST(cles::from_json<value>("5e0").is_double());
    BOOST_TEST(cles::from_json<value>("18446744073709551616").as_double() == 18446744073709551616.0);
}

BOOST_AUTO_TEST_CASE(doubles_round_trip_exactly) {
    std::mt19937_64 random{71};
    for (int i = 0; i < 20'000; ++i) {
        const auto d = std::bit_cast<double>(random());
        if (std::isfinite(d)) {
            const auto text = cles::to_json(value(d));
            const auto back = cles::from_json<value>(text).to_number<double>();
            BOOST_REQUIRE(std::bit_cast<std::uint64_t>(back) == std::bit_cast<std::uint64_t>(d));
        }
    }
}

BOOST_AUTO_TEST_CASE(zero_keeps_its_sign) {
    BOOST_TEST(std::signbit(cles::from_json<value>(cles::to_json(value(-0.0))).to_number<double>()));
    BOOST_TEST(std::signbit(cles::from_json<value>("[-0]").at(0).to_number<double>()));
    BOOST_TEST(cles::to_json(cles::from_json<value>("-0")) == "-0");
    BOOST_TEST(cles::from_json<value>("0").is_int64());
}

BOOST_AUTO_TEST_CASE(keys_and_strings_are_unescaped_and_escaped) {
    const auto tree = cles::from_json<value>("{\"\\u00e4\":\"\\\"\",\"plain\":\"\\uD83D\\uDE97\"}");
    BOOST_TEST((tree.at("\xC3\xA4").as_string() == "\""));
    BOOST_TEST(cles::to_json(tree) == "{\"\xC3\xA4\":\"\\\"\",\"plain\":\"\xF0\x9F\x9A\x97\"}");
}

BOOST_AUTO_TEST_CASE(an_error_names_the_path) {
    BOOST_TEST(why("{\"a\":[1,{\"b\":x}]}") == "a[1].b: expected a value, got something that is not JSON");
    BOOST_TEST(why("[1e400]") == "[0]: a number out of the range of a double");
    BOOST_TEST(why("") == "expected a value, but the text ends");
    BOOST_TEST(why(std::string(33, '[') + std::string(33, ']')).ends_with("nested deeper than 32 levels"));
}

BOOST_AUTO_TEST_CASE(an_object_or_an_array_can_be_requested) {
    BOOST_TEST((cles::from_json<boost::json::object>("{\"a\":1}").at("a").as_int64() == 1));
    BOOST_TEST(cles::from_json<boost::json::array>("[1,2]").size() == 2U);
    boost::json::object object;
    BOOST_TEST(!cles::from_json("[1]", object));
    boost::json::array array;
    BOOST_TEST(!cles::from_json("{}", array));
    BOOST_TEST(cles::to_json(boost::json::object{{"a", {1, 2}}}) == "{\"a\":[1,2]}");
    BOOST_TEST(cles::to_json(std::vector<value>{1, "x", nullptr}) == "[1,\"x\",null]");
}

BOOST_AUTO_TEST_CASE(reading_replaces_what_was_there) {
    value v = {1, 2, 3};
    BOOST_TEST(cles::from_json("{\"a\":1}", v));
    BOOST_TEST(cles::to_json(v) == "{\"a\":1}");
    BOOST_TEST(cles::from_json("null", v));
    BOOST_TEST(v.is_null());
}

BOOST_AUTO_TEST_SUITE_END()
