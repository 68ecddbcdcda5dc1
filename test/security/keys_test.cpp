// SPDX-License-Identifier: BSL-1.0
#include "security/fleet_fixture.hpp"
#include "security/keys/keys.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>
#include <vector>

namespace keys {
namespace {

using namespace cles::security;

using test::from_hex;
using test::to_hex;

template <class Key>
Key key_of(std::string_view hex) {
    const auto bytes = from_hex(hex);
    Key key{};
    BOOST_REQUIRE(bytes.size() == key.size());
    std::copy(bytes.begin(), bytes.end(), key.begin());
    return key;
}

signing_key key_from_seed(std::string_view hex) { return signing_key{secret_bytes{from_hex(hex)}}; }

} // namespace

BOOST_AUTO_TEST_SUITE(keys)

// RFC 8032, section 7.1, TEST 3.
BOOST_AUTO_TEST_CASE(a_signature_is_that_of_rfc_8032) {
    const auto key = key_from_seed("c5aa8df43f9f837bedb7442f31dcb7b166d38535076f094b85ce3a2e0b4458f7");
    BOOST_TEST(to_hex(key.public_part()) == "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025");
    const auto made = key.sign("\xaf\x82");
    BOOST_TEST(to_hex(made) == "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac"
                               "18ff9b538d16f290ae67f760984dc6594a7c15e9716ed28dc027beceea1ec40a");
    BOOST_TEST(verify(key.public_part(), "\xaf\x82", made));
}

BOOST_AUTO_TEST_CASE(a_signature_counts_for_its_text_and_key_only) {
    const auto key = signing_key::generate();
    const auto made = key.sign("text");
    BOOST_TEST(verify(key.public_part(), "text", made));
    BOOST_TEST(!verify(key.public_part(), "texT", made));
    BOOST_TEST(!verify(key.public_part(), "", made));
    BOOST_TEST(!verify(signing_key::generate().public_part(), "text", made));
    for (std::size_t bit = 0; bit < 8 * made.size(); ++bit) {
        auto other = made;
        other[bit / 8] = static_cast<std::uint8_t>(other[bit / 8] ^ (1U << bit % 8));
        BOOST_TEST(!verify(key.public_part(), "text", other));
    }
}

// Adding the order of the group to S makes another signature of the same text, which RFC 8032 refuses.
BOOST_AUTO_TEST_CASE(s_is_below_the_order_of_the_group) {
    const auto order = from_hex("edd3f55c1a631258d69cf7a2def9de1400000000000000000000000000000010");
    const auto key = signing_key::generate();
    auto made = key.sign("text");
    unsigned carry = 0;
    for (std::size_t i = 0; i < 32; ++i) {
        carry += made[32 + i] + order[i];
        made[32 + i] = static_cast<std::uint8_t>(carry);
        carry >>= 8U;
    }
    BOOST_TEST(carry == 0U);
    BOOST_TEST(!verify(key.public_part(), "text", made));
}

BOOST_AUTO_TEST_CASE(both_parts_have_the_same_x25519_form) {
    const auto key = key_from_seed("e86abb4a48c92563202f5d9aeacd3ceff65756e31fa971013989bfd2f85e494b");
    BOOST_TEST(to_hex(key.agreement_part()) == "c437a6218e195054a142ec79330f2fa89c2db9d0cea6f19701fc957c5af35f4a");
    BOOST_REQUIRE(agreement_form(key.public_part()));
    BOOST_TEST(*agreement_form(key.public_part()) == key.agreement_part());
}

BOOST_AUTO_TEST_CASE(only_points_of_prime_order_in_their_only_encoding_are_keys) {
    const std::string_view zeros = "00000000000000000000000000000000000000000000000000000000000000";
    for (const auto& hex : {
             std::string{"01"}.append(zeros),                                                 // the neutral element
             std::string{"00"}.append(zeros),                                                 // order 4
             std::string{"c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac037a"}, // order 8
             std::string{"ecffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"}, // order 2
             std::string{"edffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"}, // order 4, as p
             std::string{"eeffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"}, // neutral, as p + 1
             std::string{"f0ffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f"}, // y = 3, as p + 3
             std::string{"02"}.append(zeros),                                                 // not a point
             // A valid key, with a point of order 8 or 2 added.
             std::string{"6a04fa7acf0934cb8ab34fbcb40c7f58b109fbee389d186d8e22f705e87de8be"},
             std::string{"b295d84331495bd29d5c572fd590f28c9acdea88e21dbc59c53fb75e74a625d6"},
         }) {
        BOOST_TEST(!agreement_form(key_of<public_key>(hex)), hex);
    }
    // All encodings of y from the field's prime on.
    for (unsigned y = 0; y < 19; ++y) {
        public_key key{};
        key.fill(0xff);
        key[0] = static_cast<std::uint8_t>(0xed + y);
        BOOST_TEST(!agreement_form(key));
        key[31] = 0x7f;
        BOOST_TEST(!agreement_form(key));
    }
}

BOOST_AUTO_TEST_CASE(a_private_key_has_32_bytes) {
    BOOST_CHECK_THROW(signing_key{secret_bytes{31}}, security_error);
    BOOST_CHECK_THROW(signing_key{secret_bytes{33}}, security_error);
    BOOST_CHECK_THROW(signing_key{secret_bytes{}}, security_error);
}

BOOST_AUTO_TEST_CASE(new_keys_differ) {
    BOOST_TEST(signing_key::generate().public_part() != signing_key::generate().public_part());
}

BOOST_AUTO_TEST_CASE(a_sealed_box_opens_for_its_receiver_only) {
    const auto receiver = signing_key::generate();
    const auto content = from_hex("000102030405");
    auto box = seal_box(receiver.agreement_part(), content);
    BOOST_TEST(box.size() == content.size() + sealed_overhead);
    const auto opened = receiver.open_box(box);
    BOOST_TEST(std::ranges::equal(opened.view(), content));
    BOOST_TEST(signing_key::generate().open_box(box).size() == 0U);
    box.back() ^= 1U;
    BOOST_TEST(receiver.open_box(box).size() == 0U);
    BOOST_TEST(receiver.open_box(bytes_view{box}.first(sealed_overhead - 1)).size() == 0U);
    BOOST_TEST(receiver.open_box(bytes_view{box}.first(sealed_overhead)).size() == 0U);
    BOOST_TEST(receiver.open_box({}).size() == 0U);
}

BOOST_AUTO_TEST_CASE(base64url_has_one_spelling) {
    BOOST_TEST(to_base64url(from_hex("fbff")) == "-_8");
    BOOST_TEST(to_base64url({}).empty());
    std::vector<std::uint8_t> two(2);
    BOOST_TEST(read_base64url("-_8", two));
    BOOST_TEST(to_hex(two) == "fbff");
    for (const std::string_view text : {"-_9", "-_8=", "-_", "-_8A", "+/8", " -_8", "-_8\n", "", "-"}) {
        BOOST_TEST(!read_base64url(text, two), text);
    }
    BOOST_TEST(!read_base64url(std::string_view{"-_8\0", 4}, two));
    BOOST_TEST(!read_base64url(std::string_view{"-\0_8", 4}, two));
    // No other byte stands for one of these characters.
    for (std::size_t at = 0; at < 3; ++at) {
        std::string text{"AAA"};
        std::size_t accepted = 0;
        for (unsigned byte = 0; byte < 256; ++byte) {
            text[at] = static_cast<char>(byte);
            if (read_base64url(text, two)) {
                BOOST_TEST(to_base64url(two) == text);
                ++accepted;
            }
        }
        BOOST_TEST(accepted == (at == 2 ? 16U : 64U));
    }
    std::vector<std::uint8_t> none;
    BOOST_TEST(read_base64url("", none));
    BOOST_TEST(!read_base64url("A", none));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace keys
