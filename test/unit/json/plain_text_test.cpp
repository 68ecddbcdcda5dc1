// SPDX-License-Identifier: BSL-1.0
#include "json/json_scan.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <string>

namespace plain_text {
namespace {

using cles::json_detail::is_plain;
using cles::json_detail::plain_end;

} // namespace
} // namespace plain_text

BOOST_AUTO_TEST_SUITE(plain_text)

BOOST_AUTO_TEST_CASE(printable_ascii_is_plain_except_two_characters) {
    for (int i = 0; i < 256; ++i) {
        BOOST_TEST(is_plain(static_cast<char>(i)) == (i >= 0x20 && i < 0x80 && i != '"' && i != '\\'), i);
    }
}

BOOST_AUTO_TEST_CASE(a_run_ends_at_a_character_that_is_not_plain_at_any_position) {
    constexpr std::size_t length = 19; // two words and a remainder
    for (std::size_t at = 0; at < length; ++at) {
        for (int i = 0; i < 256; ++i) {
            std::string text(length, 'x');
            text[at] = static_cast<char>(i);
            const auto expected = is_plain(text[at]) ? length : at;
            BOOST_REQUIRE(plain_end(text, 0) == expected);
            BOOST_REQUIRE(plain_end(text, at) == expected);
        }
    }
}

BOOST_AUTO_TEST_CASE(the_first_of_several_ends_it) {
    for (std::size_t first = 0; first < 8; ++first) {
        for (const char other : {'\0', '\x1F', '"', '\\', '\x80', '\xFF'}) {
            std::string text(8, '!');
            text[first] = '"';
            text[7] = other;
            BOOST_REQUIRE(plain_end(text, 0) == first);
        }
    }
}

BOOST_AUTO_TEST_CASE(nothing_is_read_past_the_end) {
    for (std::size_t length = 0; length < 20; ++length) {
        const std::string text(length, 'x');
        for (std::size_t at = 0; at <= length; ++at) {
            BOOST_REQUIRE(plain_end(text, at) == length);
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
