// SPDX-License-Identifier: BSL-1.0
#include "security/keys/keys.hpp"

#include <algorithm>
#include <utility>

#include <sodium.h>

namespace cles::security {
namespace {

constexpr auto unpadded = sodium_base64_VARIANT_URLSAFE_NO_PADDING;

} // namespace

signing_key signing_key::generate() { return signing_key{secret_bytes::random(crypto_sign_SEEDBYTES)}; }

signing_key::signing_key(secret_bytes seed)
    : seed_(std::move(seed)), secret_(crypto_sign_SECRETKEYBYTES), agreement_secret_(crypto_scalarmult_SCALARBYTES) {
    if (seed_.size() != crypto_sign_SEEDBYTES) {
        throw security_error{"a private key has 32 bytes"};
    }
    crypto_sign_seed_keypair(public_.data(), secret_.data(), seed_.data());
    crypto_sign_ed25519_sk_to_curve25519(agreement_secret_.data(), secret_.data());
    crypto_scalarmult_base(agreement_.data(), agreement_secret_.data());
}

signature signing_key::sign(std::string_view text) const {
    signature made{};
    crypto_sign_detached(made.data(), nullptr, as_bytes(text).data(), text.size(), secret_.data());
    return made;
}

secret_bytes signing_key::open_box(bytes_view box) const {
    static_assert(sealed_overhead == crypto_box_SEALBYTES);
    if (box.size() <= sealed_overhead) {
        return {};
    }
    secret_bytes content{box.size() - sealed_overhead};
    if (crypto_box_seal_open(content.data(), box.data(), box.size(), agreement_.data(), agreement_secret_.data()) !=
        0) {
        return {};
    }
    return content;
}

bool verify(const public_key& by, std::string_view text, const signature& made) {
    prepare_sodium();
    return crypto_sign_verify_detached(made.data(), as_bytes(text).data(), text.size(), by.data()) == 0;
}

std::optional<agreement_key> agreement_form(const public_key& key) {
    prepare_sodium();
    agreement_key form{};
    // The conversion refuses points that are not of prime order. It would accept a second encoding, which only points
    // with y below 19 have; none of them is of prime order.
    if (crypto_sign_ed25519_pk_to_curve25519(form.data(), key.data()) != 0) {
        return {};
    }
    return form;
}

std::vector<std::uint8_t> seal_box(const agreement_key& receiver, bytes_view content) {
    prepare_sodium();
    std::vector<std::uint8_t> box(content.size() + sealed_overhead);
    if (crypto_box_seal(box.data(), content.data(), content.size(), receiver.data()) != 0) {
        throw security_error{"cannot seal for a key of low order"};
    }
    return box;
}

std::string to_base64url(bytes_view bytes) {
    std::string text(sodium_base64_encoded_len(bytes.size(), unpadded), '\0');
    sodium_bin2base64(text.data(), text.size(), bytes.data(), bytes.size(), unpadded);
    text.pop_back(); // the terminating zero
    return text;
}

bool read_base64url(std::string_view text, std::span<std::uint8_t> out) {
    if (out.empty()) {
        return text.empty();
    }
    // libsodium 1.0.18 reads all bytes above these as '_'.
    if (std::ranges::any_of(text, [](char c) { return static_cast<unsigned char>(c) >= 0x80; })) {
        return false;
    }
    std::size_t size = 0;
    return sodium_base642bin(out.data(), out.size(), text.data(), text.size(), nullptr, &size, nullptr, unpadded) ==
               0 &&
           size == out.size();
}

} // namespace cles::security
