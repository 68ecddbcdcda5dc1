// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

/// Noise_KK_25519_ChaChaPoly_SHA256 (Noise Protocol Framework, revision 34): a handshake of two messages between ends
/// that know each other's static keys, and the sealing of what follows.
///
/// Functions that return false have found a message that is not authentic, or a key of low order: an agreement whose
/// result is zero is refused. What they have written then is of no use.

namespace cles::security {

using noise_hash = std::array<std::uint8_t, 32>;

/// By how much a handshake message is longer than its payload: the ephemeral key before it, the tag behind it.
constexpr std::size_t noise_overhead = 32 + 16;

/// The static keys of a handshake: this end's pair and the other end's public key.
struct noise_keys {
    const secret_bytes& secret; ///< lives longer than the handshake
    agreement_key own{};
    agreement_key peer{};
};

/// What a handshake results in: the keys of both directions.
class traffic_keys {
  public:
    [[nodiscard]] const std::uint8_t* of_initiator() const noexcept { return bytes_.data(); }
    [[nodiscard]] const std::uint8_t* of_responder() const noexcept { return bytes_.data() + 32; }
    [[nodiscard]] std::uint8_t* data() noexcept { return bytes_.data(); }

  private:
    secret_bytes bytes_{64};
};

/// The end that sends the first message. It keeps what it needs for the second one.
class noise_initiator {
  public:
    /// \param ephemeral a new private key, of 32 random bytes
    noise_initiator(noise_keys keys, secret_bytes ephemeral);
    /// \pre message.size() == payload.size() + noise_overhead
    [[nodiscard]] bool write(bytes_view prologue, bytes_view payload, std::span<std::uint8_t> message);
    /// Changes nothing here, so that a forged message does not keep the real one out.
    /// \pre the same, and `write` has succeeded
    [[nodiscard]] bool read(bytes_view message, std::span<std::uint8_t> payload, traffic_keys& result,
                            noise_hash* hash = nullptr) const;

  private:
    noise_keys keys_;
    secret_bytes kept_; // the ephemeral private key and the chaining key
    noise_hash hash_{};
};

/// The other end.
class noise_responder {
  public:
    explicit noise_responder(noise_keys keys);
    /// \pre message.size() == payload.size() + noise_overhead
    [[nodiscard]] bool read(bytes_view prologue, bytes_view message, std::span<std::uint8_t> payload);
    /// \param ephemeral a new private key, of 32 random bytes
    /// \pre the same, and `read` has succeeded
    [[nodiscard]] bool write(bytes_view payload, const secret_bytes& ephemeral, std::span<std::uint8_t> message,
                             traffic_keys& result, noise_hash* hash = nullptr);

  private:
    noise_keys keys_;
    secret_bytes chaining_;
    noise_hash hash_{};
    agreement_key peer_ephemeral_{};
};

/// A transport message. \pre to.size() == plain.size() + 16; `key` has 32 bytes
void noise_seal(const std::uint8_t* key, std::uint64_t counter, bytes_view additional, bytes_view plain,
                std::uint8_t* to);
/// \pre sealed.size() >= 16; `to` has space for 16 less
[[nodiscard]] bool noise_open(const std::uint8_t* key, std::uint64_t counter, bytes_view additional, bytes_view sealed,
                              std::uint8_t* to);

} // namespace cles::security
