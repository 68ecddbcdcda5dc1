// SPDX-License-Identifier: BSL-1.0
#include "json/json_scan.hpp"

#include <boost/test/unit_test.hpp>

#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>

namespace json_scan {
namespace {

/// The number at the start of a text, or what is wrong with it.
std::string number(std::string_view text, bool* integral = nullptr) {
    std::size_t at = 0;
    bool whole = false;
    const auto wrong = cles::json_detail::scan_number(text, at, whole);
    if (integral != nullptr) {
        *integral = whole;
    }
    return wrong.empty() ? std::string{text.substr(0, at)} : std::string{wrong};
}

struct scanned {
    std::string wrong;
    std::string raw;
    bool escaped = false;
    std::size_t at = 0;
};

scanned string(std::string_view text) {
    scanned result;
    std::string_view raw;
    result.wrong = cles::json_detail::scan_string(text, result.at, raw, result.escaped);
    result.raw = raw;
    return result;
}

bool unescapes(std::string_view raw) {
    std::string out;
    return cles::json_detail::unescape(raw, out);
}

} // namespace
} // namespace json_scan

BOOST_AUTO_TEST_SUITE(json_scan)

BOOST_AUTO_TEST_CASE(a_number_ends_where_its_characters_end) {
    BOOST_TEST(number("12]") == "12");
    BOOST_TEST(number("-0.5e+10,") == "-0.5e+10");
    BOOST_TEST(number("0x1") == "0");
    BOOST_TEST(number("1.5.5") == "1.5");
    bool integral = false;
    number("12", &integral);
    BOOST_TEST(integral);
    number("1e2", &integral);
    BOOST_TEST(!integral);
    number("1.0", &integral);
    BOOST_TEST(!integral);
}

BOOST_AUTO_TEST_CASE(errors_in_a_number_are_reported) {
    BOOST_TEST(number("01") == "a number has no leading zeros");
    BOOST_TEST(number("-") == "'-' without a digit");
    BOOST_TEST(number("-x") == "'-' without a digit");
    BOOST_TEST(number("1.") == "'.' without a digit");
    BOOST_TEST(number("1e+") == "an exponent without a digit");
}

BOOST_AUTO_TEST_CASE(a_decimal_of_the_usual_form_has_19_digits_at_most_and_no_exponent) {
    const auto takes = [](std::string_view text) {
        std::size_t at = 0;
        double out = 0;
        return cles::json_detail::read_decimal(text, at, out);
    };
    for (const std::string_view quick :
         {"0", "-0", "7", "1234567890123456789", "-0.000000000000000001", "123456789012345678.5,", "45.1]"}) {
        BOOST_TEST(takes(quick), quick);
    }
    for (const std::string_view other :
         {"", "-", "01", "12345678901234567890", "0.1234567890123456789", "1.", "1e5", "1.5E5", "x",
          "99999999999999999999999999999999999999", "0.00000000000000000000000000001"}) {
        BOOST_TEST(!takes(other), other); // left for the general algorithm
    }
    std::size_t at = 1;
    double out = 0;
    BOOST_TEST(cles::json_detail::read_decimal("[-45.125]", at, out));
    BOOST_TEST(out == -45.125);
    BOOST_TEST(at == 8U);
}

// As the standard library does, which rounds correctly: half way between two doubles, to the even one.
BOOST_AUTO_TEST_CASE(a_decimal_of_the_usual_form_is_the_nearest_double) {
    std::mt19937_64 draw{20261130};
    const auto check = [](const std::string& text) {
        std::size_t at = 0;
        double out = 0;
        double nearest = 0;
        BOOST_REQUIRE_MESSAGE(cles::json_detail::read_decimal(text, at, out), text);
        std::from_chars(text.data(), text.data() + text.size(), nearest);
        BOOST_REQUIRE_MESSAGE(std::bit_cast<std::uint64_t>(out) == std::bit_cast<std::uint64_t>(nearest), text);
    };
    const auto with_point = [](std::string digits, std::size_t decimals) {
        if (digits.size() <= decimals) {
            digits.insert(0, decimals + 1 - digits.size(), '0');
        }
        return decimals == 0 ? digits : digits.insert(digits.size() - decimals, ".");
    };
    constexpr std::uint64_t over = 10'000'000'000'000'000'000U;
    for (int i = 0; i < 200'000; ++i) {
        auto number = draw() % over;
        for (auto shorter = draw() % 19; shorter != 0; --shorter) {
            number /= 10;
        }
        const auto digits = std::to_string(number);
        check(with_point(digits, draw() % digits.size()));
    }
    for (const auto* half :
         {"9007199254740993", "9007199254740995", "-9007199254740993.0", "4503599627370497.5", "4503599627370496.5",
          "9007199254740992.999", "9223372036854775808", "9223372036854775807", "9223372036854776832",
          "9223372036854777856", "9999999999999999999", "0.100000000000000005"}) {
        check(half);
    }
}

BOOST_AUTO_TEST_CASE(a_string_ends_at_its_quote) {
    const auto plain = string("\"a b\",1");
    BOOST_TEST(plain.wrong.empty());
    BOOST_TEST(plain.raw == "a b");
    BOOST_TEST(!plain.escaped);
    BOOST_TEST(plain.at == 5U);
    const auto quoted = string("\"\\\"\\\\\" \"");
    BOOST_TEST(quoted.raw == "\\\"\\\\");
    BOOST_TEST(quoted.escaped);
}

BOOST_AUTO_TEST_CASE(errors_in_a_string_are_reported) {
    BOOST_TEST(string("\"abc").wrong == "a string without an end");
    BOOST_TEST(string("\"abc\\\"").wrong == "a string without an end");
    BOOST_TEST(string("\"a\nb\"").wrong == "a control character in a string");
    BOOST_TEST(string("\"\xFF\"").wrong == "invalid UTF-8 in a string");
    BOOST_TEST(!string("\"\\x\"").wrong.empty());
    BOOST_TEST(!string("\"\\u12\"").wrong.empty());
    BOOST_TEST(!string("\"\\").wrong.empty());
}

BOOST_AUTO_TEST_CASE(half_of_a_surrogate_pair_is_an_error) {
    for (const std::string_view bad :
         {"\\uD800", "\\uDFFF", "\\uD800a", "\\uD800\\n", "\\uD800\\u0041", "\\uDC00\\uD800", "\\uD83D\\uD83D"}) {
        BOOST_TEST(!unescapes(bad), bad);
    }
    BOOST_TEST(unescapes("\\uD83D\\uDE97"));
    BOOST_TEST(unescapes("\\uD7FF\\uE000"));
}

BOOST_AUTO_TEST_SUITE_END()
