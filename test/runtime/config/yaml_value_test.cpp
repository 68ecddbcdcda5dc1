// SPDX-License-Identifier: BSL-1.0
#include "config/config_values.hpp"
#include "config/yaml_value.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

using cles::runtime::invalid_value;
using cles::runtime::yaml_to_json;

namespace yaml_value {
namespace {

std::string json(const std::string& text) { return yaml_to_json(YAML::Load(text)); }

} // namespace
} // namespace yaml_value

BOOST_AUTO_TEST_SUITE(yaml_value)

BOOST_AUTO_TEST_CASE(json_scalars_stay_and_others_become_strings) {
    BOOST_TEST(json("{limit: 100000, ratio: -1.5e3, on: true, off: false, none: null, tilde: ~, gap: }") ==
               R"({"limit":100000,"ratio":-1.5e3,"on":true,"off":false,"none":null,"tilde":null,"gap":null})");
    BOOST_TEST(json("[007, 1., .5, +1, 0x10, 1 000, yes, 2026-11-21, a b]") ==
               R"(["007","1.",".5","+1","0x10","1 000","yes","2026-11-21","a b"])");
}

BOOST_AUTO_TEST_CASE(quoted_scalars_are_strings) {
    BOOST_TEST(json(R"({a: "1", b: 'true', c: "null"})") == R"({"a":"1","b":"true","c":"null"})");
}

BOOST_AUTO_TEST_CASE(strings_are_escaped) {
    BOOST_TEST(json("{\"a\\\"b\": \"line\\nline\"}") == R"({"a\"b":"line\nline"})");
}

BOOST_AUTO_TEST_CASE(json_is_unchanged) {
    for (const auto* text :
         {R"({"limit":100000,"name":"x","list":[1,2.5,true,null,"7"],"inner":{"a":[]}})", "{}", "[]"}) {
        BOOST_TEST(json(text) == text);
    }
}

BOOST_AUTO_TEST_CASE(null_is_an_empty_object) { BOOST_TEST(json("~") == "{}"); }

BOOST_AUTO_TEST_CASE(a_scalar_is_refused) {
    BOOST_CHECK_THROW(json("7"), invalid_value);
    BOOST_CHECK_THROW(json("'{}'"), invalid_value);
}

BOOST_AUTO_TEST_CASE(depth_is_bounded) {
    BOOST_TEST(json(std::string(32, '[') + std::string(32, ']')).size() == 64U);
    BOOST_CHECK_THROW(json(std::string(33, '[') + std::string(33, ']')), invalid_value);
}

BOOST_AUTO_TEST_CASE(anchors_cannot_exceed_the_size_limit) {
    std::string text = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
    for (int i = 1; i < 10; ++i) {
        const auto last = "*a" + std::to_string(i - 1);
        std::string items = last;
        for (int k = 1; k < 10; ++k) {
            items += ", " + last;
        }
        text += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + items + "]\n";
    }
    BOOST_CHECK_THROW(json(text), invalid_value);
}

BOOST_AUTO_TEST_SUITE_END()
