// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/secret.hpp"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// Keys of members and fleets: Ed25519 (RFC 8032) for signatures, and its X25519 form (RFC 7748) for agreement.

namespace cles::security {

/// Something that docs/protocol_security.md refuses. The message is for people and names what is wrong.
class security_error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

using public_key = std::array<std::uint8_t, 32>;    ///< Ed25519
using agreement_key = std::array<std::uint8_t, 32>; ///< X25519, public
using signature = std::array<std::uint8_t, 64>;     ///< Ed25519

/// What a sealed box adds to its content.
inline constexpr std::size_t sealed_overhead = 48;

/// An Ed25519 private key.
class signing_key {
  public:
    /// A new key.
    static signing_key generate();
    /// \param seed the 32 bytes of RFC 8032 \throws security_error if it has another size
    explicit signing_key(secret_bytes seed);

    [[nodiscard]] const public_key& public_part() const noexcept { return public_; }
    [[nodiscard]] const agreement_key& agreement_part() const noexcept { return agreement_; }
    [[nodiscard]] const secret_bytes& seed() const noexcept { return seed_; }
    [[nodiscard]] const secret_bytes& agreement_secret() const noexcept { return agreement_secret_; }
    [[nodiscard]] signature sign(std::string_view text) const;
    /// Opens a sealed box of libsodium; empty if it is not for this key.
    [[nodiscard]] secret_bytes open_box(bytes_view box) const;

  private:
    secret_bytes seed_;
    secret_bytes secret_; // of libsodium: seed and public key
    secret_bytes agreement_secret_;
    public_key public_{};
    agreement_key agreement_{};
};

[[nodiscard]] bool verify(const public_key& by, std::string_view text, const signature& made);

/// The X25519 form of a key; none if it is not a point of prime order in its only encoding.
[[nodiscard]] std::optional<agreement_key> agreement_form(const public_key& key);

/// A sealed box of libsodium, which only the receiver can open.
[[nodiscard]] std::vector<std::uint8_t> seal_box(const agreement_key& receiver, bytes_view content);

/// Base64url without padding (RFC 4648, section 5). Not for secrets: their text must be in locked memory, too.
[[nodiscard]] std::string to_base64url(bytes_view bytes);
/// Reads exactly `out.size()` bytes. False for any other text, including other spellings of the same bytes.
[[nodiscard]] bool read_base64url(std::string_view text, std::span<std::uint8_t> out);

} // namespace cles::security
