// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/noise_kk.hpp"

#include <algorithm>
#include <string_view>

#include <sodium.h>

namespace cles::security {
namespace {

using secret_block = std::array<std::uint8_t, 32>;

// In the terms of the specification: ck, h and k. Each key seals one payload, so its nonce is zero.
struct symmetric_state {
    secret_block chaining{};
    noise_hash hash{};
    secret_block key{};

    symmetric_state() = default;
    symmetric_state(const symmetric_state&) = delete;
    symmetric_state& operator=(const symmetric_state&) = delete;
    ~symmetric_state() {
        sodium_memzero(chaining.data(), chaining.size());
        sodium_memzero(key.data(), key.size());
    }

    void start(bytes_view prologue, const agreement_key& initiator, const agreement_key& responder) {
        constexpr std::string_view name =
            "Noise_KK_25519_ChaChaPoly_SHA256"; // as long as a hash, so it is the first one
        std::ranges::copy(name, hash.begin());
        chaining = hash;
        mix_hash(prologue);
        mix_hash(initiator);
        mix_hash(responder);
    }

    void mix_hash(bytes_view data) {
        crypto_hash_sha256_state h;
        crypto_hash_sha256_init(&h);
        crypto_hash_sha256_update(&h, hash.data(), hash.size());
        crypto_hash_sha256_update(&h, data.data(), data.size());
        crypto_hash_sha256_final(&h, hash.data());
    }

    // False: the agreement is refused.
    [[nodiscard]] bool mix_agreement(const std::uint8_t* secret, const std::uint8_t* peer) {
        secret_block shared{};
        const bool good = crypto_scalarmult(shared.data(), secret, peer) == 0; // fails if the result is zero
        if (good) {
            expand(shared, chaining.data(), key.data());
        }
        sodium_memzero(shared.data(), shared.size());
        return good;
    }

    // HKDF with two outputs.
    void expand(bytes_view material, std::uint8_t* first, std::uint8_t* second) const {
        secret_block extracted{};
        keyed_hash(chaining.data(), material, 0, extracted.data());
        secret_block one{};
        keyed_hash(extracted.data(), {}, 1, one.data());
        secret_block two{};
        keyed_hash(extracted.data(), one, 2, two.data());
        std::ranges::copy(one, first);
        std::ranges::copy(two, second);
        sodium_memzero(extracted.data(), extracted.size());
        sodium_memzero(one.data(), one.size());
        sodium_memzero(two.data(), two.size());
    }

    void seal(bytes_view payload, std::uint8_t* to) {
        noise_seal(key.data(), 0, hash, payload, to);
        mix_hash({to, payload.size() + crypto_aead_chacha20poly1305_ietf_ABYTES});
    }
    [[nodiscard]] bool open(bytes_view sealed, std::uint8_t* to) {
        if (!noise_open(key.data(), 0, hash, sealed, to)) {
            return false;
        }
        mix_hash(sealed);
        return true;
    }

  private:
    static void keyed_hash(const std::uint8_t* key, bytes_view data, std::uint8_t last, std::uint8_t* to) {
        crypto_auth_hmacsha256_state h;
        crypto_auth_hmacsha256_init(&h, key, 32);
        crypto_auth_hmacsha256_update(&h, data.data(), data.size());
        if (last != 0) {
            crypto_auth_hmacsha256_update(&h, &last, 1);
        }
        crypto_auth_hmacsha256_final(&h, to);
        sodium_memzero(&h, sizeof h);
    }
};

std::array<std::uint8_t, 12> nonce_of(std::uint64_t counter) {
    std::array<std::uint8_t, 12> nonce{};
    for (std::size_t i = 4; i < nonce.size(); ++i, counter >>= 8U) { // little-endian
        nonce[i] = static_cast<std::uint8_t>(counter);
    }
    return nonce;
}

void report_hash(const symmetric_state& state, noise_hash* hash) {
    if (hash != nullptr) {
        *hash = state.hash;
    }
}

} // namespace

void noise_seal(const std::uint8_t* key, std::uint64_t counter, bytes_view additional, bytes_view plain,
                std::uint8_t* to) {
    crypto_aead_chacha20poly1305_ietf_encrypt(to, nullptr, plain.data(), plain.size(), additional.data(),
                                              additional.size(), nullptr, nonce_of(counter).data(), key);
}

bool noise_open(const std::uint8_t* key, std::uint64_t counter, bytes_view additional, bytes_view sealed,
                std::uint8_t* to) {
    return crypto_aead_chacha20poly1305_ietf_decrypt(to, nullptr, nullptr, sealed.data(), sealed.size(),
                                                     additional.data(), additional.size(), nonce_of(counter).data(),
                                                     key) == 0;
}

// -- the initiator -------------------------------------------------------------------------------------------------

noise_initiator::noise_initiator(noise_keys keys, secret_bytes ephemeral) : keys_(keys), kept_(64) {
    std::ranges::copy(ephemeral.view(), kept_.data());
}

bool noise_initiator::write(bytes_view prologue, bytes_view payload, std::span<std::uint8_t> message) {
    const auto* const ephemeral = kept_.data();
    symmetric_state state;
    state.start(prologue, keys_.own, keys_.peer);
    crypto_scalarmult_base(message.data(), ephemeral);
    state.mix_hash(message.first(32));
    if (!state.mix_agreement(ephemeral, keys_.peer.data()) ||           // es
        !state.mix_agreement(keys_.secret.data(), keys_.peer.data())) { // ss
        return false;
    }
    state.seal(payload, message.data() + 32);
    std::ranges::copy(state.chaining, kept_.data() + 32);
    hash_ = state.hash;
    return true;
}

bool noise_initiator::read(bytes_view message, std::span<std::uint8_t> payload, traffic_keys& result,
                           noise_hash* hash) const {
    symmetric_state state;
    std::copy_n(kept_.data() + 32, state.chaining.size(), state.chaining.begin());
    state.hash = hash_;
    state.mix_hash(message.first(32));
    if (!state.mix_agreement(kept_.data(), message.data()) ||        // ee
        !state.mix_agreement(keys_.secret.data(), message.data()) || // se
        !state.open(message.subspan(32), payload.data())) {
        return false;
    }
    state.expand({}, result.data(), result.data() + 32);
    report_hash(state, hash);
    return true;
}

// -- the responder -------------------------------------------------------------------------------------------------

noise_responder::noise_responder(noise_keys keys) : keys_(keys), chaining_(32) {}

bool noise_responder::read(bytes_view prologue, bytes_view message, std::span<std::uint8_t> payload) {
    symmetric_state state;
    state.start(prologue, keys_.peer, keys_.own);
    state.mix_hash(message.first(32));
    if (!state.mix_agreement(keys_.secret.data(), message.data()) ||    // es
        !state.mix_agreement(keys_.secret.data(), keys_.peer.data()) || // ss
        !state.open(message.subspan(32), payload.data())) {
        return false;
    }
    std::ranges::copy(state.chaining, chaining_.data());
    hash_ = state.hash;
    std::ranges::copy(message.first(32), peer_ephemeral_.begin());
    return true;
}

bool noise_responder::write(bytes_view payload, const secret_bytes& ephemeral, std::span<std::uint8_t> message,
                            traffic_keys& result, noise_hash* hash) {
    symmetric_state state;
    std::copy_n(chaining_.data(), state.chaining.size(), state.chaining.begin());
    state.hash = hash_;
    crypto_scalarmult_base(message.data(), ephemeral.data());
    state.mix_hash(message.first(32));
    if (!state.mix_agreement(ephemeral.data(), peer_ephemeral_.data()) || // ee
        !state.mix_agreement(ephemeral.data(), keys_.peer.data())) {      // se
        return false;
    }
    state.seal(payload, message.data() + 32);
    state.expand({}, result.data(), result.data() + 32);
    report_hash(state, hash);
    return true;
}

} // namespace cles::security
