// SPDX-License-Identifier: BSL-1.0
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>

namespace json_writer {
namespace {

template <class T>
std::string written(const T& value) {
    std::string out;
    cles::json_writer{out}.value(value);
    return out;
}

std::string text(std::string_view value) { return written(value); }

bool reads_back(double d) {
    const auto out = written(d);
    cles::json_reader reader{out};
    double back = 0;
    return reader.read(back) && reader.at_end() &&
           std::bit_cast<std::uint64_t>(back) == std::bit_cast<std::uint64_t>(d);
}

// The significant digits of a number's text.
std::string digits_of(std::string_view number) {
    std::string digits;
    for (const auto c : number.substr(0, number.find('e'))) {
        if (c >= '0' && c <= '9' && !(digits.empty() && c == '0')) {
            digits += c;
        }
    }
    digits.erase(std::find_if(digits.rbegin(), digits.rend(), [](char c) { return c != '0'; }).base(), digits.end());
    return digits;
}

std::string shortest(double d) {
    char buffer[64];
    return {buffer, std::to_chars(buffer, buffer + sizeof buffer, d).ptr};
}

} // namespace
} // namespace json_writer

BOOST_AUTO_TEST_SUITE(json_writer)

BOOST_AUTO_TEST_CASE(commas_and_colons_are_inserted_without_white_space) {
    std::string out = "head ";
    cles::json_writer w{out};
    w.begin_object();
    w.key("a");
    w.value(std::int64_t{-1});
    w.key("b");
    w.begin_array();
    w.value(true);
    w.null();
    w.begin_object();
    w.end_object();
    w.begin_array();
    w.end_array();
    w.value(std::uint64_t{18'446'744'073'709'551'615U});
    w.end_array();
    w.plain_key("c");
    w.value(std::string_view{"{"});
    w.key("d");
    w.raw("[1,2]");
    w.end_object();
    BOOST_TEST(out == "head {\"a\":-1,\"b\":[true,null,{},[],18446744073709551615],\"c\":\"{\",\"d\":[1,2]}");
    BOOST_TEST(w.written() == std::string_view{out}.substr(5));
}

BOOST_AUTO_TEST_CASE(a_string_that_ends_in_a_bracket_or_colon_is_followed_by_a_comma) {
    std::string out;
    cles::json_writer w{out};
    w.begin_array();
    for (const std::string_view s : {"[", "{", ":", ","}) {
        w.value(s);
    }
    w.end_array();
    BOOST_TEST(out == "[\"[\",\"{\",\":\",\",\"]");
}

BOOST_AUTO_TEST_CASE(prepared_keys_are_separated_like_others) {
    std::string out = "head {";
    cles::json_writer w{out};
    w.begin_object();
    static constexpr cles::prepared_key_text<1> a{"a"};
    w.plain_key(a);
    w.begin_object();
    w.end_object();
    static constexpr cles::prepared_key_text<1> b{"b"};
    w.plain_key(b);
    w.value(std::int64_t{1});
    w.end_object();
    BOOST_TEST(w.written() == "{\"a\":{},\"b\":1}");
}

BOOST_AUTO_TEST_CASE(a_writer_ignores_what_precedes_it) {
    std::string out = "1";
    cles::json_writer{out}.value(std::int64_t{2});
    BOOST_TEST(out == "12");
}

BOOST_AUTO_TEST_CASE(integers_are_written_over_their_whole_range) {
    BOOST_TEST(written(std::numeric_limits<std::int64_t>::min()) == "-9223372036854775808");
    BOOST_TEST(written(std::int64_t{0}) == "0");
}

BOOST_AUTO_TEST_CASE(doubles_are_written_as_people_write_them) {
    struct example {
        double value;
        std::string_view expected;
    };
    const example examples[] = {{45.1, "45.1"},
                                {0.0, "0"},
                                {-0.0, "-0"},
                                {1.0, "1"},
                                {-2.5, "-2.5"},
                                {0.1, "0.1"},
                                {100.0, "100"},
                                {0.001, "0.001"},
                                {1700000000.25, "1700000000.25"},
                                {-0.000001, "-0.000001"},
                                {123456.789, "123456.789"},
                                {1e300, "1e+300"}};
    for (const auto& e : examples) {
        BOOST_TEST(written(e.value) == e.expected);
    }
}

BOOST_AUTO_TEST_CASE(doubles_round_trip_exactly) {
    std::mt19937_64 random{41};
    for (int i = 0; i < 200'000; ++i) {
        const auto d = std::bit_cast<double>(random());
        if (std::isfinite(d)) {
            BOOST_TEST_REQUIRE(reads_back(d), shortest(d));
        }
    }
    std::uniform_real_distribution<double> near{-1000.0, 1000.0};
    std::uniform_real_distribution<double> exponent{-20.0, 20.0};
    for (int i = 0; i < 200'000; ++i) {
        const auto d = i % 2 == 0 ? near(random) : std::pow(10.0, exponent(random));
        BOOST_TEST_REQUIRE(reads_back(d), shortest(d));
        const auto decimal = std::round(near(random) * 1e6) / 1e6; // like measurements
        BOOST_TEST_REQUIRE(reads_back(decimal), shortest(decimal));
    }
    for (const double d :
         {std::numeric_limits<double>::max(), std::numeric_limits<double>::min(), 5e-324, -5e-324, 9007199254740993.0,
          9007199254740991.0, 999999999999999.9, 1e15, 1e-9, 1e-10, 0.1 + 0.2, 999999.9999999999, 1e22, 1e23}) {
        BOOST_TEST(reads_back(d), shortest(d));
        BOOST_TEST(reads_back(-d), shortest(-d));
    }
}

BOOST_AUTO_TEST_CASE(doubles_are_written_with_the_fewest_digits_that_read_back_the_same) {
    std::mt19937_64 random{43};
    std::uniform_real_distribution<double> near{-1e6, 1e6};
    for (int i = 0; i < 100'000; ++i) {
        const auto scale = std::pow(10.0, static_cast<double>(random() % 12));
        const auto d = std::round(near(random) * scale) / scale;
        const auto out = written(d);
        BOOST_TEST_REQUIRE(digits_of(out) == digits_of(shortest(d)), out << " for " << shortest(d));
        BOOST_TEST_REQUIRE(cles::is_valid_json(out), out);
    }
}

BOOST_AUTO_TEST_CASE(a_double_that_is_not_finite_becomes_null) {
    BOOST_TEST(written(std::numeric_limits<double>::infinity()) == "null");
    BOOST_TEST(written(-std::numeric_limits<double>::infinity()) == "null");
    BOOST_TEST(written(std::numeric_limits<double>::quiet_NaN()) == "null");
}

BOOST_AUTO_TEST_CASE(strings_are_escaped_only_where_necessary) {
    BOOST_TEST(text("plain /\x7F \xC3\xA4\xE2\x82\xAC\xF0\x9F\x9A\x97") ==
               "\"plain /\x7F \xC3\xA4\xE2\x82\xAC\xF0\x9F\x9A\x97\"");
    BOOST_TEST(text("\"\\\b\f\n\r\t") == "\"\\\"\\\\\\b\\f\\n\\r\\t\"");
    BOOST_TEST(text(std::string_view{"\0\x01\x1F", 3}) == "\"\\u0000\\u0001\\u001f\"");
    BOOST_TEST(text("") == "\"\"");
}

BOOST_AUTO_TEST_CASE(text_that_is_not_utf8_is_written_with_replacement_characters) {
    BOOST_TEST(text("a\xFFz") == "\"a\xEF\xBF\xBDz\"");
    BOOST_TEST(text("\xC3") == "\"\xEF\xBF\xBD\"");
    BOOST_TEST(text("\xE2\x82z") == "\"\xEF\xBF\xBD\xEF\xBF\xBDz\"");
}

BOOST_AUTO_TEST_CASE(any_bytes_become_a_valid_string_without_line_ends) {
    std::mt19937 random{47};
    for (int i = 0; i < 20'000; ++i) {
        std::string bytes(random() % 40, '\0');
        for (auto& c : bytes) {
            c = static_cast<char>(random() % 256);
        }
        const auto out = text(bytes);
        BOOST_REQUIRE(cles::is_valid_json(out));
        BOOST_REQUIRE(out.find('\n') == std::string::npos);
    }
}

BOOST_AUTO_TEST_CASE(strings_survive_a_round_trip) {
    std::mt19937 random{53};
    const std::string_view pieces[] = {
        "a", "\"", "\\", "\n", "\x01", "\xC3\xA4", "\xE2\x82\xAC", "\xF0\x9F\x9A\x97", "/", "\\u0041"};
    for (int i = 0; i < 5'000; ++i) {
        std::string value;
        for (auto count = random() % 20; count != 0; --count) {
            value += pieces[random() % std::size(pieces)];
        }
        const auto out = text(value);
        cles::json_reader reader{out};
        std::string back;
        BOOST_REQUIRE(reader.read(back));
        BOOST_REQUIRE(back == value);
    }
}

BOOST_AUTO_TEST_SUITE_END()
