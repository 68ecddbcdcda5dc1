// SPDX-License-Identifier: BSL-1.0
#include <cles/json_reader.hpp>

#include <boost/json/parse.hpp>
#include <boost/json/value.hpp>
#include <boost/test/unit_test.hpp>

#include <bit>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace json_reader {
namespace {

using kind = cles::json_reader::kind;

std::string why(std::string_view text) {
    std::string message;
    return cles::is_valid_json(text, 32, &message) ? "(valid)" : message;
}

template <class T>
struct read_result {
    bool ok = false;
    T value{};
    std::string error{};
};

template <class T>
read_result<T> read(std::string_view text) {
    cles::json_reader reader{text};
    read_result<T> result;
    result.ok = reader.read(result.value) && reader.at_end();
    result.error = reader.error();
    return result;
}

bool tree_accepts(std::string_view text) {
    boost::json::error_code code;
    boost::json::parse_options options;
    options.max_depth = 32;
    boost::json::parse(text, code, {}, options);
    return !code;
}

// Unreadable with one per line.
// clang-format off
const std::string_view valid[] = {
    "null", "true", "false", "0", "-0", "1", "-1", "10", "1.5", "-1.5e10", "1E+2", "1e-2", "0.0", "0e0", "0.1e1",
    "123456789012345678901234567890", "\"\"", "\"a\"", "\"\\\"\\\\\\/\\b\\f\\n\\r\\t\"", "\"\\u00e4\"", "\"\\uD83D\\uDE97\"",
    "\"\xC3\xA4\xE2\x82\xAC\xF0\x9F\x9A\x97\"", "\"\x7F\"", "[]", "[ ]", "[1]", "[1,2]", "[[]]", "[[],[]]", "{}", "{ }",
    "{\"a\":1}", "{\"a\":1,\"b\":[]}", "{\"a\":{\"b\":{}}}", " [ 1 , { \"a\" : null } ] ", "\t\n\r [\t1\n]\r", "[true,false,null]",
    "{\"\":0}", "{\"a\":1,\"a\":2}", "[\"[\",\"{\",\",\",\":\"]", "\"\\u0000\"", "[1e400]", "[-1e-400]", "[0.10]",
};

const std::string_view invalid[] = {
    "", " ", "nul", "nulll", "True", "tru", "truefalse", "01", "-", "-a", "+1", ".5", "1.", "1.e1", "1e", "1e+", "0x1", "1_0",
    "00", "-01", "--1", "1 2", "NaN", "Infinity", "-Infinity", "'a'", "a", "\"", "\"a", "\"\\\"", "\"\\", "\"\\x\"", "\"\\u\"",
    "\"\\u12\"", "\"\\u12g4\"", "\"\\uD800\"", "\"\\uDC00\"", "\"\\uD800\\u0041\"", "\"\\uD800x\"", "\"\\uD800\\n\"",
    "\"\\uDC00\\uD800\"", "\"\n\"", "\"\x01\"", "\"\x1F\"", "\"\xFF\"", "\"\xC3\"", "\"\xC0\x80\"", "\"\xED\xA0\x80\"",
    "\"\xF4\x90\x80\x80\"", "\"\xC3\xC3\"", "[", "]", "[1", "[1,", "[1,]", "[,1]", "[,]", "[1 2]", "[1,,2]", "[1}", "[[]", "[]]",
    "{", "}", "{]", "{\"a\"", "{\"a\":", "{\"a\":1", "{\"a\":1,", "{\"a\":1,}", "{,}", "{a:1}", "{1:1}", "{\"a\" 1}", "{\"a\",1}",
    "{\"a\":1 \"b\":2}", "{\"a\":1;\"b\":2}", "{\"a\"::1}", "{null:1}", "{} {}", "{}x", "[]\x01", "/**/1", "1 // x", "[1]\\",
    "\xEF\xBB\xBF[]", "\\u0031", "\"a\"b", "[\"a\"\"b\"]", "[true false]", "{\"a\":1}}", "[1\v]", "[\xC2\xA0]", "\"\\U0041\"",
};
// clang-format on

} // namespace
} // namespace json_reader

BOOST_AUTO_TEST_SUITE(json_reader)

BOOST_AUTO_TEST_SUITE(validity)

BOOST_AUTO_TEST_CASE(texts_that_rfc_8259_allows_are_valid) {
    for (const auto text : valid) {
        BOOST_TEST(why(text) == "(valid)", text << ": " << why(text));
    }
}

BOOST_AUTO_TEST_CASE(other_texts_are_invalid_and_the_error_has_the_position) {
    for (const auto text : invalid) {
        BOOST_TEST(why(text).find("(at byte ") != std::string::npos, text << ": " << why(text));
    }
    BOOST_TEST(!cles::is_valid_json(std::string_view{"[1]\0", 4}));
    BOOST_TEST(!cles::is_valid_json(std::string_view{"\"a\0b\"", 5}));
    BOOST_TEST(!cles::is_valid_json(std::string_view{"\0", 1}));
}

BOOST_AUTO_TEST_CASE(it_agrees_with_another_parser) {
    for (const auto text : valid) {
        BOOST_TEST(tree_accepts(text), text);
    }
    for (const auto text : invalid) {
        BOOST_TEST(!tree_accepts(text), text);
    }
}

BOOST_AUTO_TEST_CASE(it_agrees_with_another_parser_on_damaged_texts) {
    std::mt19937 random{23};
    const std::string_view seeds[] = {"{\"utc\":1700000000.25,\"lat\":45.1,\"lon\":-7.5e-3,\"ok\":true,\"note\":"
                                      "\"a\\u00e4\\n\",\"route\":[[1,2],{\"a\":null}]}",
                                      "[{\"a\":[{\"b\":[]},-0.5,\"\\uD83D\\uDE97\"]},false,\"\xC3\xA4\",12e5]"};
    const std::string_view pieces = "{}[]\",:\\u0123456789eE+-. trufalsn\x01\xC3\xA4\xFF";
    int accepted = 0;
    for (int i = 0; i < 40'000; ++i) {
        std::string text{seeds[random() % std::size(seeds)]};
        const auto changes = 1 + random() % 3;
        for (std::size_t k = 0; k < changes; ++k) {
            const auto at = random() % text.size();
            switch (random() % 4) {
            case 0: text.erase(at, 1 + random() % 3); break;
            case 1: text.insert(at, 1, pieces[random() % pieces.size()]); break;
            case 2: text[at] = pieces[random() % pieces.size()]; break;
            default: text.resize(at + 1);
            }
            if (text.empty()) {
                text = "[";
            }
        }
        const bool ours = cles::is_valid_json(text);
        accepted += ours ? 1 : 0;
        BOOST_TEST_REQUIRE(ours == tree_accepts(text), text);
    }
    BOOST_TEST(accepted > 100);
    BOOST_TEST(accepted < 39'000);
}

BOOST_AUTO_TEST_CASE(the_depth_counts_brackets_from_1) {
    const auto nested = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
    BOOST_TEST(cles::is_valid_json("5", 0));
    BOOST_TEST(!cles::is_valid_json("[]", 0));
    BOOST_TEST(cles::is_valid_json("[]", 1));
    BOOST_TEST(!cles::is_valid_json("[{}]", 1));
    BOOST_TEST(cles::is_valid_json(nested(32)));
    BOOST_TEST(!cles::is_valid_json(nested(33)));
    BOOST_TEST(!cles::is_valid_json(std::string(1'000'000, '[')));
    BOOST_TEST(cles::is_valid_json("[[],[],[[]]]", 3)); // closed brackets do not count
    std::string objects;
    for (int i = 0; i < 32; ++i) {
        objects += "{\"a\":";
    }
    BOOST_TEST(cles::is_valid_json(objects + "1" + std::string(32, '}')));
    BOOST_TEST(!cles::is_valid_json("[" + objects + "1" + std::string(32, '}') + "]"));
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(values)

BOOST_AUTO_TEST_CASE(the_kind_of_the_next_value_can_be_peeked) {
    struct example {
        std::string_view text;
        kind expected;
    };
    const example examples[] = {{" {", kind::object}, {"[", kind::array},    {"\"", kind::string},
                                {"-", kind::number},  {"7", kind::number},   {"t", kind::boolean},
                                {"f", kind::boolean}, {"n", kind::null},     {"x", kind::invalid},
                                {"", kind::invalid},  {"  ", kind::invalid}, {"}", kind::invalid}};
    for (const auto& e : examples) {
        cles::json_reader reader{e.text};
        BOOST_TEST((reader.peek() == e.expected), e.text);
        BOOST_TEST(reader.ok());
    }
}

BOOST_AUTO_TEST_CASE(integers_are_read_over_their_whole_range) {
    BOOST_TEST(read<std::int64_t>("-9223372036854775808").value == std::numeric_limits<std::int64_t>::min());
    BOOST_TEST(read<std::int64_t>("9223372036854775807").value == std::numeric_limits<std::int64_t>::max());
    BOOST_TEST(read<std::uint64_t>("18446744073709551615").value == std::numeric_limits<std::uint64_t>::max());
    BOOST_TEST(read<std::int64_t>("-0").ok);
    for (const std::string_view bad : {"9223372036854775808", "-9223372036854775809", "1.0", "1e3", "\"1\"", "null"}) {
        BOOST_TEST(!read<std::int64_t>(bad).ok, bad);
    }
    for (const std::string_view bad : {"-1", "18446744073709551616", "0.5"}) {
        BOOST_TEST(!read<std::uint64_t>(bad).ok, bad);
    }
    BOOST_TEST(read<std::int64_t>("1.5").error == "expected an integer (at byte 3)");
    BOOST_TEST(read<std::int64_t>("9223372036854775808").error.starts_with("an integer out of range"));
}

BOOST_AUTO_TEST_CASE(doubles_are_read_exactly) {
    std::mt19937_64 random{31};
    for (int i = 0; i < 100'000; ++i) {
        const auto bits = random();
        const auto d = i % 2 == 0 ? std::bit_cast<double>(bits)
                                  : static_cast<double>(bits % 2'000'000'000) / 1e6 * (i % 4 == 1 ? 1 : -1);
        if (!std::isfinite(d)) {
            continue;
        }
        char text[64];
        const auto end = std::to_chars(text, text + sizeof text, d).ptr;
        const auto back = read<double>({text, static_cast<std::size_t>(end - text)});
        BOOST_REQUIRE(back.ok);
        BOOST_REQUIRE(std::bit_cast<std::uint64_t>(back.value) == std::bit_cast<std::uint64_t>(d));
    }
}

BOOST_AUTO_TEST_CASE(decimals_are_read_exactly_however_many_digits_they_have) {
    std::mt19937 random{37};
    for (int i = 0; i < 100'000; ++i) {
        std::string text = i % 3 == 0 ? "-" : "";
        const auto whole = 1 + random() % 18;
        text += static_cast<char>('1' + random() % 9);
        for (std::size_t k = 1; k < whole; ++k) {
            text += static_cast<char>('0' + random() % 10);
        }
        if (const auto decimals = random() % 20; decimals != 0) {
            text += '.';
            for (std::size_t k = 0; k < decimals; ++k) {
                text += static_cast<char>('0' + random() % 10);
            }
        }
        if (random() % 5 == 0) {
            text += "e" + std::to_string(static_cast<int>(random() % 40) - 20);
        }
        double expected = 0;
        std::from_chars(text.data(), text.data() + text.size(), expected);
        const auto got = read<double>(text);
        BOOST_REQUIRE(got.ok);
        BOOST_TEST_REQUIRE(std::bit_cast<std::uint64_t>(got.value) == std::bit_cast<std::uint64_t>(expected), text);
    }
    BOOST_TEST(std::signbit(read<double>("-0").value));
    BOOST_TEST(std::signbit(read<double>("-0.0").value));
    BOOST_TEST(read<double>("5e-324").value == 5e-324);
    BOOST_TEST(read<double>("1.7976931348623157e308").value == std::numeric_limits<double>::max());
}

BOOST_AUTO_TEST_CASE(a_number_out_of_the_range_of_a_double_is_an_error) {
    BOOST_TEST(read<double>("1e400").error.starts_with("a number out of the range of a double"));
    BOOST_TEST(!read<double>("-1e309").ok);
}

BOOST_AUTO_TEST_CASE(malformed_numbers_are_errors) {
    for (const std::string_view bad :
         {"01", "-", "1.", ".5", "1e", "+1", "00.5", "-01", "1.e5", "0x1", "1.5.5", "--1", "1e5.5"}) {
        BOOST_TEST(!read<double>(bad).ok, bad);
        BOOST_TEST(!read<std::int64_t>(bad).ok, bad);
    }
}

BOOST_AUTO_TEST_CASE(strings_are_unescaped) {
    BOOST_TEST(read<std::string>("\"a\\\"\\\\\\/\\b\\f\\n\\r\\tz\"").value == "a\"\\/\b\f\n\r\tz");
    BOOST_TEST(read<std::string>("\"\\u0041\\u00E4\\u20ac\\uD83D\\uDE97\"").value ==
               "A\xC3\xA4\xE2\x82\xAC\xF0\x9F\x9A\x97");
    BOOST_TEST(read<std::string>("\"\\u0000\"").value == std::string(1, '\0'));
    BOOST_TEST(read<std::string>("\"\xC3\xA4\"").value == "\xC3\xA4");
    BOOST_TEST(read<std::string_view>("\"plain\"").value == "plain");
    BOOST_TEST(!read<std::string>("5").ok);
}

BOOST_AUTO_TEST_CASE(a_plain_string_is_a_view_of_the_text) {
    const std::string_view text = "\"plain\"";
    cles::json_reader reader{text};
    std::string_view out;
    BOOST_TEST(reader.read(out));
    BOOST_TEST((out.data() == text.data() + 1));
}

BOOST_AUTO_TEST_CASE(objects_and_arrays_are_iterated) {
    cles::json_reader reader{" { \"a\" : [ 1 , 2 ] , \"\\u0062\" : { } } "};
    std::string_view key;
    std::int64_t number = 0;
    std::int64_t sum = 0;
    BOOST_TEST(reader.begin_object());
    BOOST_TEST(reader.next_key(key));
    BOOST_TEST(key == "a");
    BOOST_TEST(reader.begin_array());
    while (reader.next_element()) {
        BOOST_TEST(reader.read(number));
        sum += number;
    }
    BOOST_TEST(sum == 3);
    BOOST_TEST(reader.next_key(key));
    BOOST_TEST(key == "b");
    BOOST_TEST(reader.begin_object());
    BOOST_TEST(!reader.next_key(key));
    BOOST_TEST(!reader.next_key(key));
    BOOST_TEST(reader.ok());
    BOOST_TEST(reader.at_end());
}

BOOST_AUTO_TEST_CASE(an_expected_key_is_consumed_only_if_it_is_next) {
    cles::json_reader reader{"{\"a\":1,\"b\":2, \"c\":3}"};
    std::int64_t number = 0;
    std::string_view key;
    BOOST_TEST(reader.begin_object());
    BOOST_TEST(!reader.next_key_is("b"));
    BOOST_TEST(!reader.next_key_is(""));
    BOOST_TEST(reader.next_key_is("a"));
    BOOST_TEST(reader.read(number));
    BOOST_TEST(number == 1);
    BOOST_TEST(!reader.next_key_is("a"));
    BOOST_TEST(reader.next_key_is("b"));
    BOOST_TEST(reader.read(number));
    BOOST_TEST(!reader.next_key_is("c")); // its key is escaped
    BOOST_TEST(reader.next_key(key));
    BOOST_TEST(key == "c");
    BOOST_TEST(reader.read(number));
    BOOST_TEST(number == 3);
    BOOST_TEST(!reader.next_key_is("d"));
    BOOST_TEST(!reader.next_key(key));
    BOOST_TEST(reader.at_end());
}

BOOST_AUTO_TEST_CASE(so_is_a_prepared_one) {
    static constexpr cles::prepared_key_text<1> a{"a"};
    static constexpr cles::prepared_key_text<2> bc{"bc"};
    cles::json_reader reader{"{\"a\":1,\"bc\":2,\"a\" :3}"};
    std::int64_t number = 0;
    BOOST_TEST(cles::prepared_key{bc}.name() == "bc");
    BOOST_TEST(!reader.next_key_is(a));
    BOOST_TEST(reader.begin_object());
    BOOST_TEST(!reader.next_key_is(bc));
    BOOST_TEST(reader.next_key_is(a));
    BOOST_TEST(!reader.next_key_is(a));
    BOOST_TEST(reader.read(number));
    BOOST_TEST(!reader.next_key_is(a));
    BOOST_TEST(reader.next_key_is(bc));
    BOOST_TEST(reader.read(number));
    BOOST_TEST(number == 2);
    BOOST_TEST(!reader.next_key_is(a)); // white space before the colon
    BOOST_TEST(!reader.fail("over"));
    BOOST_TEST(!reader.next_key_is(a));
}

BOOST_AUTO_TEST_CASE(null_may_stand_for_nan) {
    double wide = 0;
    float narrow = 0;
    cles::json_reader reader{"[null, null,1.5,-2.5e1,\"x\"]"};
    BOOST_TEST(reader.begin_array());
    BOOST_TEST((reader.next_element() && reader.read_or_nan(wide) && std::isnan(wide)));
    BOOST_TEST((reader.next_element() && reader.read_or_nan(narrow) && std::isnan(narrow)));
    BOOST_TEST((reader.next_element() && reader.read_or_nan(wide) && wide == 1.5));
    BOOST_TEST((reader.next_element() && reader.read_or_nan(narrow) && narrow == -25.0F));
    BOOST_TEST((reader.next_element() && !reader.read_or_nan(wide)));
    BOOST_TEST(reader.error() == "expected a number, got a string (at byte 23)");
}

BOOST_AUTO_TEST_CASE(a_value_can_be_skipped_or_taken_as_text) {
    cles::json_reader reader{"[ {\"a\": [1, \"]\"]} , \"x\" , 5 ]"};
    std::string_view raw;
    reader.begin_array();
    reader.next_element();
    BOOST_TEST(reader.read_raw(raw));
    BOOST_TEST(raw == "{\"a\": [1, \"]\"]}");
    reader.next_element();
    BOOST_TEST(reader.skip());
    reader.next_element();
    BOOST_TEST(reader.read_raw(raw));
    BOOST_TEST(raw == "5");
    BOOST_TEST(!reader.next_element());
    BOOST_TEST(reader.at_end());
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(errors)

BOOST_AUTO_TEST_CASE(the_first_failure_is_kept_and_everything_after_it_fails) {
    cles::json_reader reader{"[1,x,2]"};
    std::int64_t number = 0;
    bool flag = false;
    std::string text;
    std::string_view key;
    reader.begin_array();
    reader.next_element();
    BOOST_TEST(!reader.read(flag));
    const auto first = reader.error();
    BOOST_TEST(first == "expected true or false, got a number (at byte 1)");
    BOOST_TEST(!reader.read(number));
    BOOST_TEST(!reader.read(text));
    BOOST_TEST(!reader.begin_object());
    BOOST_TEST(!reader.begin_array());
    BOOST_TEST(!reader.next_key(key));
    BOOST_TEST(!reader.next_key_is("a"));
    BOOST_TEST(!reader.next_element());
    BOOST_TEST(!reader.read_null());
    BOOST_TEST(!reader.skip());
    BOOST_TEST(!reader.at_end());
    BOOST_TEST(!reader.ok());
    BOOST_TEST(reader.error() == first);
}

BOOST_AUTO_TEST_CASE(an_error_names_the_path_to_where_it_happened) {
    cles::json_reader reader{"5"};
    reader.fail("is odd");
    reader.inside_member("lat");
    reader.inside_element(2);
    reader.inside_element(0);
    reader.inside_member("route");
    reader.inside_member("plan");
    BOOST_TEST(reader.error() == "plan.route[0][2].lat: is odd (at byte 0)");
}

BOOST_AUTO_TEST_CASE(an_error_says_what_was_expected_and_what_was_found) {
    BOOST_TEST(read<std::int64_t>("\"x\"").error == "expected a number, got a string (at byte 0)");
    BOOST_TEST(read<std::string>("{}").error == "expected a string, got an object (at byte 0)");
    BOOST_TEST(read<bool>("null").error == "expected true or false, got null (at byte 0)");
    BOOST_TEST(read<bool>("fals").error == "expected false, got 'fals' (at byte 0)");
    BOOST_TEST(why("[nul]") == "expected null, got 'nul' (at byte 1)");
    BOOST_TEST(why("nil") == "expected null, got 'nil' (at byte 0)");
    BOOST_TEST(why("tru\n") == "expected true, got 'tru' (at byte 0)");
    BOOST_TEST(read<bool>("").error == "expected true or false, but the text ends (at byte 0)");
    BOOST_TEST(read<std::int64_t>("5 6").error == "more text after the value (at byte 2)");
    BOOST_TEST(why("{\"a\" 1}") == "expected ':', got a number (at byte 5)");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_CASE(white_space_outside_strings_can_be_dropped) {
    std::string out = "kept ";
    cles::append_compact_json(" {\t\"a b\" :\r\n [ 1 , \" \\\" , \\\\\" , null ] } ", out);
    BOOST_TEST(out == "kept {\"a b\":[1,\" \\\" , \\\\\",null]}");
}

BOOST_AUTO_TEST_SUITE_END()
