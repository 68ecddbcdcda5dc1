// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

/// The layout of sealed datagrams (docs/protocol_security.md, "Datagrams").

namespace cles::security {

/// The first byte. Lines never begin with 0x80 or more.
enum class datagram_kind : std::uint8_t { hello = 0x81, welcome = 0x82, data = 0x83, group = 0x84 };

constexpr std::size_t seal_bytes = 16;       ///< by which an encrypted line is longer than the line
constexpr std::size_t max_line = 1200;       ///< bytes of a line
constexpr std::size_t hello_head_bytes = 12; ///< also of WELCOME
constexpr std::size_t data_head_bytes = 20;
constexpr std::size_t group_head_bytes = 32;
constexpr std::size_t group_nonce_at = 8; ///< salt and counter are the nonce
constexpr std::size_t statement_bytes = 40;
constexpr std::size_t hello_bytes = hello_head_bytes + 32 + statement_bytes + seal_bytes; ///< WELCOME is as long
constexpr std::size_t mac_bytes = 16;
constexpr std::size_t hello_with_mac_bytes = hello_bytes + mac_bytes; ///< of HELLO with a MAC
constexpr std::size_t max_data = data_head_bytes + max_line + seal_bytes;
constexpr std::size_t max_sealed = group_head_bytes + max_line + seal_bytes;

using group_salt = std::array<std::uint8_t, 16>;
using hello_datagram = std::array<std::uint8_t, hello_bytes>;
using hello_mac = std::array<std::uint8_t, mac_bytes>;

/// Whether a datagram is sealed: all others are lines.
[[nodiscard]] constexpr bool is_sealed(bytes_view datagram) noexcept {
    return !datagram.empty() && datagram.front() >= 0x80;
}

/// What each end states of itself in a handshake.
struct node_statement {
    std::uint32_t roster = 0;  ///< version of its roster
    std::uint32_t epoch = 0;   ///< its incarnation: 5f3a09c1 in lines is 0x5f3a09c1
    group_salt salt{};         ///< with which it seals for the group
    std::uint64_t counter = 0; ///< of the next datagram that it seals for the group

    bool operator==(const node_statement&) const = default;
};

/// The encrypted part of HELLO and WELCOME; the index is that of the responder, and 0 in HELLO.
[[nodiscard]] std::array<std::uint8_t, statement_bytes> write_statement(std::uint64_t index, const node_statement& s);
[[nodiscard]] node_statement read_statement(std::span<const std::uint8_t, statement_bytes> payload,
                                            std::uint64_t& index);

/// The first 12 bytes of HELLO or WELCOME.
void write_hello_head(datagram_kind kind, std::uint32_t sender, std::uint64_t index, std::uint8_t* to);
/// The first 20 bytes of DATA.
void write_data_head(std::uint32_t sender, std::uint64_t index, std::uint64_t counter, std::uint8_t* to);
/// The first 32 bytes of GROUP. Those of POOL differ in the kind.
void write_group_head(std::uint32_t sender, std::uint32_t generation, const group_salt& salt, std::uint64_t counter,
                      std::uint8_t* to);

/// What a handshake is about, so that a HELLO counts for one fleet and one responder only.
[[nodiscard]] std::array<std::uint8_t, 63> hello_prologue(const public_key& fleet, std::uint32_t responder,
                                                          std::span<const std::uint8_t, hello_head_bytes> head);

/// The readable part of any sealed datagram; nothing if the kind is unknown or the length is not one of this kind.
struct datagram_head {
    datagram_kind kind{};
    std::uint32_t sender = 0;
    std::uint64_t index = 0;      ///< of HELLO, WELCOME and DATA
    std::uint32_t generation = 0; ///< of GROUP
    group_salt salt{};            ///< of GROUP
    std::uint64_t counter = 0;    ///< of DATA and GROUP
};
[[nodiscard]] std::optional<datagram_head> read_head(bytes_view datagram) noexcept;
/// The first 32 bytes of GROUP or of POOL, whatever the kind.
[[nodiscard]] datagram_head read_group_head(const std::uint8_t* from) noexcept;

} // namespace cles::security
