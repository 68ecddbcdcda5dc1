// SPDX-License-Identifier: BSL-1.0
#include "security/keys/certificate.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <tuple>

#include <sodium.h>

namespace cles::security {
namespace {

// The DER of RFC 8410 around the bytes that differ. All lengths are constant, since those of keys and signatures are.

// PrivateKeyInfo, up to the seed.
constexpr std::array<std::uint8_t, 16> private_key_head{0x30, 0x2e, 0x02, 0x01, 0x00, 0x30, 0x05, 0x06,
                                                        0x03, 0x2b, 0x65, 0x70, 0x04, 0x22, 0x04, 0x20};
// TBSCertificate, up to the public key.
constexpr std::array<std::uint8_t, 97> certified_head{
    0x30, 0x7f,                                                              // 127 bytes follow
    0xa0, 0x03, 0x02, 0x01, 0x02,                                            // version 3
    0x02, 0x01, 0x01,                                                        // serial number 1
    0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70,                                // signed by Ed25519
    0x30, 0x0f, 0x31, 0x0d, 0x30, 0x0b, 0x06, 0x03, 0x55, 0x04, 0x03,        // issuer: the common name
    0x0c, 0x04, 'c',  'l',  'e',  's',                                       //
    0x30, 0x20,                                                              // valid
    0x17, 0x0d, '7',  '0',  '0',  '1',  '0',  '1',                           // from 1970
    '0',  '0',  '0',  '0',  '0',  '0',  'Z',                                 //
    0x18, 0x0f, '9',  '9',  '9',  '9',  '1',  '2',  '3',  '1',               // for ever (RFC 5280, 4.1.2.5)
    '2',  '3',  '5',  '9',  '5',  '9',  'Z',                                 //
    0x30, 0x0f, 0x31, 0x0d, 0x30, 0x0b, 0x06, 0x03, 0x55, 0x04, 0x03,        // subject
    0x0c, 0x04, 'c',  'l',  'e',  's',                                       //
    0x30, 0x2a, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x03, 0x21, 0x00}; // an Ed25519 key
// Certificate, before and after what is certified.
constexpr std::array<std::uint8_t, 3> certificate_head{0x30, 0x81, 0xcb};
constexpr std::array<std::uint8_t, 10> signature_head{0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x03, 0x41, 0x00};

constexpr std::size_t certified_size = certified_head.size() + std::tuple_size_v<public_key>;
constexpr std::size_t certificate_content = certified_size + signature_head.size() + std::tuple_size_v<signature>;
static_assert(certified_size == 2 + 0x7f && certificate_content == 0xcb);

constexpr std::string_view pem_begin = "-----BEGIN ";
constexpr std::string_view pem_end = "-----END ";
constexpr std::string_view pem_rest = "-----\n";
constexpr std::size_t pem_bytes_of_line = 48; // 64 characters
constexpr int pem_base64 = sodium_base64_VARIANT_ORIGINAL;

std::size_t pem_size(std::string_view label, std::size_t content) {
    const auto lines = content / pem_bytes_of_line;
    const auto rest = content % pem_bytes_of_line;
    constexpr std::size_t whole_line = pem_bytes_of_line / 3 * 4 + 1;
    return pem_begin.size() + pem_end.size() + 2 * (label.size() + pem_rest.size()) + lines * whole_line +
           (rest != 0 ? (rest + 2) / 3 * 4 + 1 : 0);
}

std::uint8_t* append_pem(std::uint8_t* at, std::string_view label, bytes_view content) {
    const auto append = [&at](std::string_view text) { at = std::ranges::copy(text, at).out; };
    append(pem_begin);
    append(label);
    append(pem_rest);
    while (!content.empty()) {
        const auto part = content.first(std::min(content.size(), pem_bytes_of_line));
        const auto characters = (part.size() + 2) / 3 * 4;
        // It writes a terminating zero, which is then overwritten.
        sodium_bin2base64(reinterpret_cast<char*>(at), characters + 1, part.data(), part.size(), pem_base64);
        at += characters;
        append("\n");
        content = content.subspan(part.size());
    }
    append(pem_end);
    append(label);
    append(pem_rest);
    return at;
}

std::array<std::uint8_t, certificate_head.size() + certificate_content> certificate_of(const signing_key& key) {
    std::array<std::uint8_t, certificate_head.size() + certificate_content> made{};
    auto* at = std::ranges::copy(certificate_head, made.data()).out;
    const auto* const certified = at;
    at = std::ranges::copy(certified_head, at).out;
    at = std::ranges::copy(key.public_part(), at).out;
    const bytes_view text{certified, certified_size};
    const auto signed_by_key = key.sign(as_text(text));
    at = std::ranges::copy(signature_head, at).out;
    std::ranges::copy(signed_by_key, at);
    return made;
}

} // namespace

secret_bytes to_pem(const signing_key& key) {
    constexpr std::string_view key_label = "PRIVATE KEY";
    constexpr std::string_view certificate_label = "CERTIFICATE";
    secret_bytes private_key{private_key_head.size() + key.seed().size()};
    auto* const seed = std::ranges::copy(private_key_head, private_key.data()).out;
    std::ranges::copy(key.seed().view(), seed);
    const auto certificate = certificate_of(key);
    secret_bytes out{pem_size(key_label, private_key.size()) + pem_size(certificate_label, certificate.size())};
    auto* const at = append_pem(out.data(), key_label, private_key.view());
    append_pem(at, certificate_label, certificate);
    return out;
}

} // namespace cles::security
