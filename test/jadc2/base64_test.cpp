// SPDX-License-Identifier: BSL-1.0
#include "fmv/base64.hpp"

#include <boost/test/unit_test.hpp>

#include <numeric>

namespace base64 {
namespace {

std::string encoded(std::string_view text) {
    const std::vector<std::uint8_t> bytes{text.begin(), text.end()};
    return fmv::to_base64(bytes);
}

} // namespace
} // namespace base64

BOOST_AUTO_TEST_SUITE(base64)

BOOST_AUTO_TEST_CASE(the_standards_own_examples) { // RFC 4648, section 10
    BOOST_TEST(encoded("") == "");
    BOOST_TEST(encoded("f") == "Zg==");
    BOOST_TEST(encoded("fo") == "Zm8=");
    BOOST_TEST(encoded("foo") == "Zm9v");
    BOOST_TEST(encoded("foob") == "Zm9vYg==");
    BOOST_TEST(encoded("fooba") == "Zm9vYmE=");
    BOOST_TEST(encoded("foobar") == "Zm9vYmFy");
}

BOOST_AUTO_TEST_CASE(all_bytes_come_back_at_each_length) {
    for (std::size_t size = 0; size < 300; ++size) {
        std::vector<std::uint8_t> bytes(size);
        std::iota(bytes.begin(), bytes.end(), std::uint8_t{static_cast<std::uint8_t>(size)});
        const auto back = fmv::from_base64(fmv::to_base64(bytes), size);
        BOOST_TEST_REQUIRE(back.has_value());
        BOOST_TEST((*back == bytes));
        BOOST_TEST(fmv::base64_size(fmv::to_base64(bytes)) == size);
    }
}

BOOST_AUTO_TEST_CASE(what_is_not_so_many_bytes_is_refused) {
    BOOST_TEST(!fmv::from_base64("Zm9v", 2));
    BOOST_TEST(!fmv::from_base64("Zm9v", 4));
    BOOST_TEST(!fmv::from_base64("Zm9", 2));
    BOOST_TEST(!fmv::from_base64("Zm8x", 2));
    BOOST_TEST(!fmv::from_base64("", 1));
    BOOST_TEST(fmv::from_base64("", 0).has_value());
}

BOOST_AUTO_TEST_CASE(what_is_no_letter_is_refused_wherever_it_stands) {
    for (const char* text : {"Z!9v", "!m9v", "Zm!v", "Zm9!", "Zm9=", "Zm\n9"}) {
        BOOST_TEST(!fmv::from_base64(text, 3), text);
    }
    BOOST_TEST(!fmv::from_base64(std::string{"Zm9\xff"}, 3));
}

BOOST_AUTO_TEST_SUITE_END()
