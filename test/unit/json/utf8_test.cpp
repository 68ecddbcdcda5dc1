// SPDX-License-Identifier: BSL-1.0
#include "json/json_scan.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace utf8 {
namespace {

// The encoding of a code point by the standard's rules, whether or not the code point is valid.
std::string encode(std::uint32_t c) {
    const auto byte = [](std::uint32_t b) { return static_cast<char>(b); };
    if (c < 0x80) {
        return {byte(c)};
    }
    if (c < 0x800) {
        return {byte(0xC0U | (c >> 6U)), byte(0x80U | (c & 0x3FU))};
    }
    if (c < 0x10000) {
        return {byte(0xE0U | (c >> 12U)), byte(0x80U | ((c >> 6U) & 0x3FU)), byte(0x80U | (c & 0x3FU))};
    }
    return {byte(0xF0U | (c >> 18U)), byte(0x80U | ((c >> 12U) & 0x3FU)), byte(0x80U | ((c >> 6U) & 0x3FU)),
            byte(0x80U | (c & 0x3FU))};
}

} // namespace
} // namespace utf8

BOOST_AUTO_TEST_SUITE(utf8)

BOOST_AUTO_TEST_CASE(every_code_point_except_surrogates_is_accepted) {
    std::size_t wrong = 0;
    for (std::uint32_t c = 0; c <= 0x110FFF; ++c) {
        const auto text = encode(c);
        const bool valid = c <= 0x10FFFF && (c < 0xD800 || c > 0xDFFF);
        if (cles::json_detail::utf8_sequence(text, 0) != (valid ? text.size() : 0)) {
            ++wrong;
        }
    }
    BOOST_TEST(wrong == 0U);
}

BOOST_AUTO_TEST_CASE(truncated_sequences_are_refused) {
    for (const std::uint32_t c : {0xE4U, 0x20ACU, 0x1F697U}) {
        auto text = encode(c);
        BOOST_TEST(cles::json_detail::is_utf8(text));
        text.pop_back();
        BOOST_TEST(!cles::json_detail::is_utf8(text));
        BOOST_TEST(!cles::json_detail::is_utf8(text + "a"));
    }
}

BOOST_AUTO_TEST_CASE(overlong_forms_and_stray_bytes_are_refused) {
    for (const std::string_view bad :
         {"\x80", "\xBF", "\xC0\x80", "\xC1\xBF", "\xE0\x80\x80", "\xE0\x9F\xBF", "\xF0\x80\x80\x80",
          "\xF0\x8F\xBF\xBF", "\xF4\x90\x80\x80", "\xF8\x88\x80\x80\x80", "\xFE", "\xFF", "a\xFFz", "\xC3\xC3\xA4"}) {
        BOOST_TEST(!cles::json_detail::is_utf8(bad));
    }
}

BOOST_AUTO_TEST_CASE(text_is_checked_to_its_end) {
    BOOST_TEST(cles::json_detail::is_utf8(""));
    BOOST_TEST(cles::json_detail::is_utf8("plain, \xC3\xA4, \xE2\x82\xAC, \xF0\x9F\x9A\x97"));
    BOOST_TEST(cles::json_detail::is_utf8(std::string_view("\0", 1)));
    BOOST_TEST(!cles::json_detail::is_utf8("fine until here \xE2\x82"));
}

BOOST_AUTO_TEST_SUITE_END()
