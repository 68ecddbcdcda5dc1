// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/hello_macs.hpp"

#include "security/keys/bytes.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

#include <sodium.h>

namespace cles::security {
namespace {

constexpr std::string_view mac_label = "cles hello 1\n";
constexpr std::size_t mac_key_bytes = 32;

// A key of its own for each direction and purpose: Noise uses the same secret.
void derive_mac_key(const secret_bytes& agreed, bytes_view fleet_key, std::uint32_t from, std::uint32_t to,
                    std::uint8_t* key) {
    std::array<std::uint8_t, 6> numbers{};
    store_big<3>(from, numbers.data());
    store_big<3>(to, numbers.data() + 3);
    crypto_auth_hmacsha256_state h;
    crypto_auth_hmacsha256_init(&h, agreed.data(), agreed.size());
    crypto_auth_hmacsha256_update(&h, as_bytes(mac_label).data(), mac_label.size());
    crypto_auth_hmacsha256_update(&h, fleet_key.data(), fleet_key.size());
    crypto_auth_hmacsha256_update(&h, numbers.data(), numbers.size());
    crypto_auth_hmacsha256_final(&h, key);
    sodium_memzero(&h, sizeof h);
}

hello_mac mac_of(const std::uint8_t* key, bytes_view hello) {
    crypto_auth_hmacsha256_state h;
    std::array<std::uint8_t, 32> whole{};
    crypto_auth_hmacsha256_init(&h, key, mac_key_bytes);
    crypto_auth_hmacsha256_update(&h, hello.data(), hello.size());
    crypto_auth_hmacsha256_final(&h, whole.data());
    sodium_memzero(&h, sizeof h);
    hello_mac mac{};
    std::copy_n(whole.begin(), mac.size(), mac.begin());
    return mac;
}

} // namespace

const secret_bytes& hello_macs::agree(const member& with) {
    auto& kept = agreed_[with.number];
    const auto own = fleet_.self()->number;
    if (kept.both.size() == 0 || kept.peer != with.agreement || kept.own != own) {
        kept = {.peer = with.agreement, .own = own, .both = {}};
        secret_bytes agreed{32};
        const bool is_agreed = crypto_scalarmult(agreed.data(), fleet_.own_key().agreement_secret().data(),
                                                 with.agreement.data()) == 0; // fails if the result is zero
        if (is_agreed) {
            kept.both = secret_bytes{2 * mac_key_bytes};
            const auto& of = fleet_.in_force().fleet();
            derive_mac_key(agreed, of, own, with.number, kept.both.data());
            derive_mac_key(agreed, of, with.number, own, kept.both.data() + mac_key_bytes);
        }
    }
    return kept.both;
}

hello_mac hello_macs::make(const member& to, bytes_view hello) {
    const auto& keys = agree(to);
    return keys.size() == 0 ? hello_mac{} : mac_of(keys.data(), hello);
}

bool hello_macs::verify(const member& from, bytes_view hello, bytes_view mac) {
    const auto& keys = agree(from);
    if (keys.size() == 0 || mac.size() != mac_bytes) {
        return false;
    }
    const auto expected = mac_of(keys.data() + mac_key_bytes, hello);
    return sodium_memcmp(expected.data(), mac.data(), expected.size()) == 0;
}

} // namespace cles::security
