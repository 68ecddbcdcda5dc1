// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/noise_kk.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace noise_kk {
namespace {

using namespace cles::security;
using namespace cles::security::test;

agreement_key key_of(std::string_view hex) {
    agreement_key key{};
    std::ranges::copy(from_hex(hex), key.begin());
    return key;
}

secret_bytes secret_of(std::string_view hex) { return secret_bytes{from_hex(hex)}; }

bytes_view text_bytes(std::string_view text) {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

bytes sealed(const std::uint8_t* key, std::uint64_t counter, std::string_view line, bytes_view additional = {}) {
    bytes out(line.size() + seal_bytes);
    noise_seal(key, counter, additional, text_bytes(line), out.data());
    return out;
}

secret_bytes ephemeral(std::size_t which) {
    return secret_of(
        boost::json::value_to<std::string>(vectors().at("handshake").at("ephemeral_secrets").as_array().at(which)));
}

// Both ends with the keys of the vectors.
struct two_ends {
    signing_key car1 = vector_key("car1");
    signing_key car2 = vector_key("car2");
    bytes prologue = from_hex(vector_text("handshake", "prologue"));
    bytes hello = from_hex(vector_text("handshake", "hello"));
    bytes welcome = from_hex(vector_text("handshake", "welcome"));

    [[nodiscard]] noise_initiator initiator() const {
        return noise_initiator{
            {.secret = car1.agreement_secret(), .own = car1.agreement_part(), .peer = car2.agreement_part()},
            ephemeral(0)};
    }
    [[nodiscard]] noise_responder responder() const { return responder_for(car1.agreement_part()); }
    [[nodiscard]] noise_responder responder_for(const agreement_key& peer) const {
        return noise_responder{{.secret = car2.agreement_secret(), .own = car2.agreement_part(), .peer = peer}};
    }
    [[nodiscard]] bytes_view message(const bytes& datagram) const {
        return bytes_view{datagram}.subspan(hello_head_bytes);
    }
    // The payloads, by the other end.
    [[nodiscard]] bytes hello_payload() const {
        bytes payload(statement_bytes);
        BOOST_REQUIRE(responder().read(prologue, message(hello), payload));
        return payload;
    }
};

} // namespace

BOOST_AUTO_TEST_SUITE(noise_kk)

// The vectors of Cacophony for this protocol (github.com/haskell-cryptography/cacophony).
BOOST_AUTO_TEST_CASE(known_answers_of_another_implementation) {
    const auto static1 = secret_of("e61ef9919cde45dd5f82166404bd08e38bceb5dfdfded0a34c8df7ed542214d1");
    const auto static2 = secret_of("4a3acbfdb163dec651dfa3194dece676d437029c62a408b4c5ea9114246e4893");
    const auto public1 = key_of("6bc3822a2aa7f4e6981d6538692b3cdf3e6df9eea6ed269eb41d93c22757b75a");
    const auto public2 = key_of("31e0303fd6418d2f8c0e78b91f22e8caed0fbe48656dcf4767e4834f701b8f62");
    noise_initiator first{{.secret = static1, .own = public1, .peer = public2},
                          secret_of("893e28b9dc6ca8d611ab664754b8ceb7bac5117349a4439a6b0569da977c464a")};
    noise_responder second{{.secret = static2, .own = public2, .peer = public1}};
    const std::string_view one = "Ludwig von Mises";
    const std::string_view two = "Murray Rothbard";
    const auto prologue = text_bytes("John Galt");

    bytes message(one.size() + noise_overhead);
    BOOST_REQUIRE(first.write(prologue, text_bytes(one), message));
    BOOST_TEST(to_hex(message) == "ca35def5ae56cec33dc2036731ab14896bc4c75dbb07a61f879f8e3afa4c7944"
                                  "0177015efc1fe7a37c629af7120a96274e6ab7afcc9261901d0e09ae32a5bb96");
    bytes payload(one.size());
    BOOST_REQUIRE(second.read(prologue, message, payload));
    BOOST_TEST(std::ranges::equal(payload, text_bytes(one)));

    traffic_keys keys1;
    traffic_keys keys2;
    noise_hash hash1{};
    noise_hash hash2{};
    message.resize(two.size() + noise_overhead);
    BOOST_REQUIRE(second.write(text_bytes(two),
                               secret_of("bbdb4cdbd309f1a1f2e1456967fe288cadd6f712d65dc7b7793d5e63da6b375b"), message,
                               keys2, &hash2));
    BOOST_TEST(to_hex(message) == "95ebc60d2b1fa672c1f46a8aa265ef51bfe38e7ccb39ec5be34069f144808843"
                                  "b274d3429adc47ca093ba63ef90f8da89fda108db471dccfa4894aa7b00003");
    payload.resize(two.size());
    BOOST_REQUIRE(first.read(message, payload, keys1, &hash1));
    BOOST_TEST(std::ranges::equal(payload, text_bytes(two)));
    BOOST_TEST(to_hex(hash1) == "24c6b51ecb76277140ca018b5985bc9f03de321dae2d34dcae433dafef0131d9");
    BOOST_TEST(hash1 == hash2);
    for (const auto* const keys : {&keys1, &keys2}) {
        BOOST_TEST(to_hex(sealed(keys->of_initiator(), 0, "F. A. Hayek")) ==
                   "966b05bc69ec01b8454d3160a214e6f24a3d884eb31ec2408af63f");
        BOOST_TEST(to_hex(sealed(keys->of_responder(), 0, "Carl Menger")) ==
                   "0ad887fba4f611bbb4afe44ba3556b8164332ca7d5934634d63d80");
    }
}

BOOST_FIXTURE_TEST_CASE(the_vectors_hold_in_both_directions, two_ends) {
    auto first = initiator();
    auto second = responder();
    const auto stated = hello_payload();
    bytes made(stated.size() + noise_overhead);
    BOOST_REQUIRE(first.write(prologue, stated, made));
    BOOST_TEST(std::ranges::equal(made, message(hello)));

    traffic_keys keys1;
    traffic_keys keys2;
    noise_hash hash1{};
    noise_hash hash2{};
    bytes answer(statement_bytes);
    BOOST_REQUIRE(first.read(message(welcome), answer, keys1, &hash1));
    bytes payload(statement_bytes);
    BOOST_REQUIRE(second.read(prologue, message(hello), payload));
    BOOST_REQUIRE(second.write(answer, ephemeral(1), made, keys2, &hash2));
    BOOST_TEST(std::ranges::equal(made, message(welcome)));
    BOOST_TEST(to_hex(hash1) == vector_text("handshake", "hash"));
    BOOST_TEST(hash1 == hash2);
    for (const auto* const keys : {&keys1, &keys2}) {
        BOOST_TEST(to_hex(bytes_view{keys->of_initiator(), 32}) == vector_text("handshake", "initiator_sends_with"));
        BOOST_TEST(to_hex(bytes_view{keys->of_responder(), 32}) == vector_text("handshake", "responder_sends_with"));
    }

    std::uint64_t index = 1;
    const auto statement = read_statement(std::span<const std::uint8_t>{stated}.first<statement_bytes>(), index);
    BOOST_TEST(index == 0U);
    BOOST_TEST(statement.roster == 7U);
    BOOST_TEST(statement.epoch == 0x0a0b0c0dU);
    BOOST_TEST(statement.counter == 41U);
}

BOOST_FIXTURE_TEST_CASE(data_of_the_vectors_is_opened_and_made, two_ends) {
    auto first = initiator();
    bytes made(hello.size() - hello_head_bytes);
    BOOST_REQUIRE(first.write(prologue, hello_payload(), made));
    traffic_keys keys;
    bytes answer(statement_bytes);
    BOOST_REQUIRE(first.read(message(welcome), answer, keys));
    for (const auto& entry : vectors().at("data").as_array()) {
        const auto& data = entry.as_object();
        const auto counter = data.at("counter").to_number<std::uint64_t>();
        const auto line = text_at(data, "line");
        const bool of_car1 = text_at(data, "from") == "car1";
        const auto* const key = of_car1 ? keys.of_initiator() : keys.of_responder();
        const auto whole = from_hex(text_at(data, "datagram"));
        const auto head = bytes_view{whole}.first(data_head_bytes);
        const auto content = bytes_view{whole}.subspan(data_head_bytes);
        bytes opened(content.size() - seal_bytes);
        BOOST_REQUIRE(noise_open(key, counter, head, content, opened.data()));
        BOOST_TEST(std::ranges::equal(opened, text_bytes(line)));
        BOOST_TEST(std::ranges::equal(sealed(key, counter, line, head), content));
        BOOST_TEST(!noise_open(key, counter + 1, head, content, opened.data()));
        const auto* const other = of_car1 ? keys.of_responder() : keys.of_initiator();
        BOOST_TEST(!noise_open(other, counter, head, content, opened.data()));
    }
}

BOOST_FIXTURE_TEST_CASE(no_bit_of_the_first_message_can_be_changed, two_ends) {
    for (std::size_t bit = 0; bit < message(hello).size() * 8; ++bit) {
        bytes changed{message(hello).begin(), message(hello).end()};
        changed[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
        bytes payload(statement_bytes);
        // The highest bit of an X25519 key is ignored, but it is part of the hash.
        BOOST_TEST(!responder().read(prologue, changed, payload), "bit " << bit);
    }
}

BOOST_FIXTURE_TEST_CASE(no_bit_of_the_second_message_can_be_changed, two_ends) {
    auto first = initiator();
    bytes made(hello.size() - hello_head_bytes);
    BOOST_REQUIRE(first.write(prologue, hello_payload(), made));
    traffic_keys keys;
    bytes payload(statement_bytes);
    for (std::size_t bit = 0; bit < message(welcome).size() * 8; ++bit) {
        bytes changed{message(welcome).begin(), message(welcome).end()};
        changed[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
        BOOST_TEST(!first.read(changed, payload, keys), "bit " << bit);
    }
    BOOST_TEST(first.read(message(welcome), payload, keys)); // forged ones do not keep it out
}

BOOST_FIXTURE_TEST_CASE(another_prologue_is_refused, two_ends) {
    bytes payload(statement_bytes);
    for (std::size_t place = 0; place < prologue.size(); ++place) {
        auto other = prologue;
        other[place] ^= 1U;
        BOOST_TEST(!responder().read(other, message(hello), payload), "byte " << place);
    }
    BOOST_TEST(!responder().read(bytes_view{prologue}.first(prologue.size() - 1), message(hello), payload));
    BOOST_TEST(!responder().read({}, message(hello), payload));
}

BOOST_FIXTURE_TEST_CASE(another_initiator_is_refused, two_ends) {
    bytes payload(statement_bytes);
    BOOST_TEST(!responder_for(vector_key("fleet").agreement_part()).read(prologue, message(hello), payload));
    BOOST_TEST(!responder_for(car2.agreement_part()).read(prologue, message(hello), payload));
}

BOOST_FIXTURE_TEST_CASE(a_message_for_another_responder_is_refused, two_ends) {
    const auto fleet = vector_key("fleet");
    noise_responder other{
        {.secret = fleet.agreement_secret(), .own = fleet.agreement_part(), .peer = car1.agreement_part()}};
    bytes payload(statement_bytes);
    BOOST_TEST(!other.read(prologue, message(hello), payload));
}

BOOST_FIXTURE_TEST_CASE(keys_of_low_order_are_refused, two_ends) {
    // All points of low order of the curve and its twist, also in their second encodings (cr.yp.to/ecdh.html).
    for (const std::string_view hex : {
             "0000000000000000000000000000000000000000000000000000000000000000",
             "0100000000000000000000000000000000000000000000000000000000000000",
             "e0eb7a7c3b41b8ae1656e3faf19fc46ada098deb9c32b1fd866205165f49b800",
             "5f9c95bca3508c24b1d0b1559c83ef5b04445cc4581c8e86d8224eddd09f1157",
             "ecffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
             "edffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
             "eeffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff7f",
         }) {
        const auto low = key_of(hex);
        bytes payload(statement_bytes);
        bytes made(statement_bytes + noise_overhead);
        traffic_keys keys;

        // An ephemeral key, in either message.
        bytes forged{message(hello).begin(), message(hello).end()};
        std::ranges::copy(low, forged.begin());
        BOOST_TEST(!responder().read(prologue, forged, payload), hex);
        auto first = initiator();
        BOOST_REQUIRE(first.write(prologue, payload, made));
        BOOST_TEST(!first.read(forged, payload, keys), hex);

        // A static key.
        noise_initiator to_low{{.secret = car1.agreement_secret(), .own = car1.agreement_part(), .peer = low},
                               ephemeral(0)};
        BOOST_TEST(!to_low.write(prologue, payload, made), hex);
    }
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace noise_kk
