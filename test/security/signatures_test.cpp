// SPDX-License-Identifier: BSL-1.0
#include "security/fleet_fixture.hpp"
#include "security/keys/signed_text.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace signatures {
namespace {

using namespace cles::security;
using namespace cles::security::test;

const public_key& fleet_key() {
    static const auto key = vector_key("fleet").public_part();
    return key;
}

// Keeps the texts that a request or an update views.
struct vector_texts {
    explicit vector_texts(std::string_view name) : all(vectors().at(name).as_object()) {}
    [[nodiscard]] std::string_view at(std::string_view key) const { return all.at(key).as_string(); }
    boost::json::object all;
};

signed_request request_of(const vector_texts& texts) {
    return {.requester = texts.at("requester"),
            .node = texts.at("node"),
            .challenge = texts.at("challenge"),
            .kind = *cles::verb_from(texts.at("verb")),
            .noun = texts.at("noun"),
            .body = texts.at("body"),
            .waits_ms = boost::json::value_to<std::uint32_t>(texts.all.at("waits_ms")),
            .bytes = texts.at("bytes")};
}

// The vectors have the value of `sig=`.
std::string_view signature_in(const vector_texts& texts) {
    const auto sig = texts.at("sig");
    return sig.substr(0, sig.find('.'));
}

signed_update update_of(const vector_texts& texts) {
    return {.publisher = texts.at("publisher"),
            .noun = texts.at("noun"),
            .seq = boost::json::value_to<std::uint64_t>(texts.all.at("seq")),
            .epoch = texts.at("epoch"),
            .body = texts.at("body")};
}

} // namespace

BOOST_AUTO_TEST_SUITE(signatures)

BOOST_AUTO_TEST_CASE(the_request_of_the_vectors_holds) {
    const vector_texts texts{"signed_request"};
    const auto request = request_of(texts);
    BOOST_TEST(text_to_sign(fleet_key(), request) ==
               "cles request 2\noJEJNdAl7UcDSSx801tdfCDUe3RHajFnIbjhvyFte54\ncar1\ncar2\nRfCf_afVdf9dWuK7AU_gmg\n"
               "DELEGATE strike/now\n{\"track\":3}\n4900\n\n");
    BOOST_TEST(sign(vector_key("car1"), fleet_key(), request) + ".4900" == texts.at("sig"));
    const auto sig = signature_in(texts);
    BOOST_TEST(verify(vector_key("car1").public_part(), fleet_key(), request, sig));
    BOOST_TEST(!verify(vector_key("car2").public_part(), fleet_key(), request, sig));
    BOOST_TEST(!verify(vector_key("car1").public_part(), vector_key("car2").public_part(), request, sig));
}

BOOST_AUTO_TEST_CASE(bytes_that_follow_a_request_are_signed) {
    const vector_texts texts{"signed_request_with_bytes"};
    const auto request = request_of(texts);
    BOOST_TEST(text_to_sign(fleet_key(), request)
                   .ends_with("\n4900\n2cf24dba5fb0a30e26e83b2ac5b9e29e1b161e5c1fa7425e73043362938b9824\n"));
    BOOST_TEST(sign(vector_key("car1"), fleet_key(), request) == signature_in(texts));
}

BOOST_AUTO_TEST_CASE(the_update_of_the_vectors_holds) {
    const vector_texts texts{"signed_update"};
    const auto update = update_of(texts);
    BOOST_TEST(text_to_sign(fleet_key(), update) ==
               "cles update 1\noJEJNdAl7UcDSSx801tdfCDUe3RHajFnIbjhvyFte54\ncar2\nlocalization\n17 5f3a09c1\n"
               "{\"utc\":2}\n");
    BOOST_TEST(sign(vector_key("car2"), fleet_key(), update) == texts.at("sig"));
    BOOST_TEST(verify(vector_key("car2").public_part(), fleet_key(), update, texts.at("sig")));
    BOOST_TEST(!verify(vector_key("car1").public_part(), fleet_key(), update, texts.at("sig")));
}

BOOST_AUTO_TEST_CASE(the_announcements_of_the_vectors_hold) {
    const vector_texts texts{"announced"};
    signed_update announcement{.publisher = texts.at("node"),
                               .noun = "cles",
                               .seq = boost::json::value_to<std::uint64_t>(texts.all.at("seq")),
                               .epoch = texts.at("epoch"),
                               .body = texts.at("announced")};
    const auto car2 = vector_key("car2");
    BOOST_TEST(sign(car2, fleet_key(), announcement) == texts.at("sig"));
    BOOST_TEST(verify(car2.public_part(), fleet_key(), announcement, texts.at("sig")));
    const auto noun = announced_noun(texts.at("challenge"));
    announcement.noun = noun;
    BOOST_TEST(sign(car2, fleet_key(), announcement) == texts.at("sig_of_reply"));
    BOOST_TEST(verify(car2.public_part(), fleet_key(), announcement, texts.at("sig_of_reply")));
    BOOST_TEST(!verify(car2.public_part(), fleet_key(), announcement, texts.at("sig")));
}

BOOST_AUTO_TEST_CASE(each_part_of_a_request_is_signed) {
    const vector_texts texts{"signed_request"};
    std::vector<signed_request> others(8, request_of(texts));
    others[0].requester = "car3";
    others[1].node = "car3";
    others[2].challenge = "AAAAAAAAAAAAAAAAAAAAAA";
    others[3].kind = cles::verb::push;
    others[4].noun = "strike";
    others[5].body = "{\"track\":4}";
    others[6].waits_ms = 4901;
    others[7].bytes = "hello";
    for (const auto& other : others) {
        BOOST_TEST(!verify(vector_key("car1").public_part(), fleet_key(), other, signature_in(texts)));
    }
}

BOOST_AUTO_TEST_CASE(each_part_of_an_update_is_signed) {
    const vector_texts texts{"signed_update"};
    std::vector<signed_update> others(5, update_of(texts));
    others[0].publisher = "car1";
    others[1].noun = "localization/fast";
    others[2].seq = 18;
    others[3].epoch = "5f3a09c2";
    others[4].body = "{\"utc\":3}";
    for (const auto& other : others) {
        BOOST_TEST(!verify(vector_key("car2").public_part(), fleet_key(), other, texts.at("sig")));
    }
}

BOOST_AUTO_TEST_CASE(no_body_is_signed_as_an_empty_object) {
    const vector_texts texts{"signed_request"};
    auto request = request_of(texts);
    request.body = "";
    auto same = request;
    same.body = "{}";
    BOOST_TEST(text_to_sign(fleet_key(), request) == text_to_sign(fleet_key(), same));
    BOOST_TEST(
        text_to_sign(fleet_key(), signed_update{.publisher = "a", .noun = "b", .epoch = "c"}).ends_with("\n{}\n"));
}

BOOST_AUTO_TEST_CASE(a_text_has_one_reading) {
    const vector_texts texts{"signed_request"};
    const auto good = request_of(texts);
    const auto refused = [](const auto& what) { return refusal([&] { return text_to_sign(fleet_key(), what); }); };
    for (const std::string_view node : {"", "car 2", "car2\nx", "car2\n"}) {
        auto wrong = good;
        wrong.node = node;
        BOOST_TEST(contains(refused(wrong), "is not a name"), node);
    }
    for (const std::string_view challenge : {"", "AAAAAAAAAAAAAAAAAAAAA", "AAAAAAAAAAAAAAAAAAAAAB",
                                             "AAAAAAAAAAAAAAAAAAAAAA\n", "AAAAAAAAAAAAAAAAAAAA=="}) {
        auto wrong = good;
        wrong.challenge = challenge;
        BOOST_TEST(contains(refused(wrong), "is not a challenge"), challenge);
    }
    auto wrong = good;
    wrong.noun = "strike\nnow";
    BOOST_TEST(refused(wrong) == "what is signed contains a line end");
    wrong = good;
    wrong.body = "{\n}";
    BOOST_TEST(refused(wrong) == "what is signed contains a line end");
    wrong = good;
    wrong.requester = "car1\n";
    BOOST_TEST(refused(wrong) == "what is signed contains a line end");
    BOOST_TEST(!verify(vector_key("car1").public_part(), fleet_key(), wrong, signature_in(texts)));
    for (const auto& update : {signed_update{.publisher = "a\n"}, signed_update{.noun = "b\n"},
                               signed_update{.epoch = "c\n"}, signed_update{.body = "{\n}"}}) {
        BOOST_TEST(refused(update) == "what is signed contains a line end");
    }
}

BOOST_AUTO_TEST_CASE(one_kind_of_signature_is_not_another) {
    const vector_texts texts{"signed_update"};
    const auto text = text_to_sign(fleet_key(), update_of(texts));
    signature made{};
    BOOST_REQUIRE(read_base64url(texts.at("sig"), made));
    BOOST_TEST(verify(vector_key("car2").public_part(), text, made));
    for (const std::string_view start : {"cles request 2\n", "cles roster 1\n"}) {
        BOOST_TEST(!verify(vector_key("car2").public_part(), replaced(text, "cles update 1\n", start), made));
    }
}

BOOST_AUTO_TEST_CASE(a_signature_has_one_spelling) {
    const vector_texts texts{"signed_update"};
    const auto update = update_of(texts);
    const std::string sig{texts.at("sig")};
    for (const auto& other : {std::string{}, sig + "=", sig + "==", sig.substr(1), sig + "A", " " + sig,
                              sig.substr(0, 85) + "B", replaced(sig, "-", "+")}) {
        BOOST_TEST(!verify(vector_key("car2").public_part(), fleet_key(), update, other), other);
    }
}

BOOST_AUTO_TEST_CASE(new_challenges_differ) {
    const auto challenge = new_challenge();
    BOOST_TEST(is_challenge(challenge));
    BOOST_TEST(challenge.size() == 22U);
    BOOST_TEST(challenge != new_challenge());
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace signatures
