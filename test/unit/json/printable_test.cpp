// SPDX-License-Identifier: BSL-1.0
#include <cles/json_reader.hpp>
#include <cles/printable.hpp>

#include <boost/test/unit_test.hpp>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace printable {
namespace {

std::string utf8(std::uint32_t c) {
    std::string out;
    if (c < 0x80) {
        out += static_cast<char>(c);
    } else if (c < 0x800) {
        out += static_cast<char>(0xc0U | c >> 6U);
        out += static_cast<char>(0x80U | (c & 0x3fU));
    } else {
        out += static_cast<char>(0xe0U | c >> 12U);
        out += static_cast<char>(0x80U | (c >> 6U & 0x3fU));
        out += static_cast<char>(0x80U | (c & 0x3fU));
    }
    return out;
}

std::string escape(std::uint32_t c) {
    constexpr std::string_view hex = "0123456789abcdef";
    std::string out = "\\u";
    for (const auto shift : {12U, 8U, 4U, 0U}) {
        out += hex[c >> shift & 0xfU];
    }
    return out;
}

bool must_be_escaped(std::uint32_t c) {
    constexpr std::array<std::array<std::uint32_t, 2>, 7> ranges{{{0x00, 0x1f},
                                                                  {0x7f, 0x9f},
                                                                  {0x061c, 0x061c},
                                                                  {0x200e, 0x200f},
                                                                  {0x202a, 0x202e},
                                                                  {0x2066, 0x2069},
                                                                  {0x110000, 0x110000}}};
    for (const auto& [first, last] : ranges) {
        if (c >= first && c <= last) {
            return true;
        }
    }
    return false;
}

} // namespace
} // namespace printable

BOOST_AUTO_TEST_SUITE(printable)

BOOST_AUTO_TEST_CASE(exactly_what_controls_is_escaped) {
    for (std::uint32_t c = 0; c < 0x10000; ++c) {
        if ((c >= 0xd800 && c < 0xe000) || c == '\n' || c == '\t' || c == '\r') {
            continue;
        }
        const auto shown = cles::printable("a" + utf8(c) + "b");
        if (shown != "a" + (must_be_escaped(c) ? escape(c) : utf8(c)) + "b") {
            BOOST_ERROR("U+" + escape(c).substr(2) + " is shown as " + shown);
        }
    }
    BOOST_TEST(cles::printable("a\nb\tc\rd") == "a\\nb\\tc\\rd");
    BOOST_TEST(cles::printable("\xf0\x9f\x9a\x97") == "\xf0\x9f\x9a\x97"); // U+1F697
}

BOOST_AUTO_TEST_CASE(what_is_not_utf8_is_replaced) {
    BOOST_TEST(cles::printable("a\x9b"
                               "31m") == "a\xef\xbf\xbd"
                                         "31m");
    BOOST_TEST(cles::printable("\xc2") == "\xef\xbf\xbd");
    BOOST_TEST(cles::printable("\xc0\x9b") == "\xef\xbf\xbd\xef\xbf\xbd"); // an overlong form
}

BOOST_AUTO_TEST_CASE(printable_text_stays_as_it_is) {
    const auto once = cles::printable("x\x1b[2J\\n \xc2\x9b\xe2\x80\xae\xff");
    BOOST_TEST(cles::printable(once) == once);
}

BOOST_AUTO_TEST_CASE(json_keeps_its_meaning) {
    const std::string json = "{\"a\xe2\x80\xae\":\"\xc2\x9b\x7f\\n\"}";
    const auto shown = cles::printable(json);
    BOOST_TEST(shown == "{\"a\\u202e\":\"\\u009b\\u007f\\n\"}");
    BOOST_TEST(cles::is_valid_json(shown));
    cles::json_reader r{shown};
    std::string_view key;
    std::string value;
    BOOST_TEST(r.begin_object());
    BOOST_TEST(r.next_key(key));
    BOOST_TEST(key == "a\xe2\x80\xae");
    BOOST_TEST(r.read(value));
    BOOST_TEST(value == "\xc2\x9b\x7f\n");
}

BOOST_AUTO_TEST_SUITE_END()
