// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/bytes.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

namespace cles::security {

/// The two addresses between which datagrams go: the other end's address and port, and the local socket, by a number
/// that its owner gives it. A plain value without Asio, cheap to make, compare and hash.
struct datagram_path {
    std::uint64_t network = 0; ///< the first 8 bytes of the IPv6 address; of an IPv4 address, those of ::ffff:0:0/96
    std::uint64_t host = 0;    ///< the last 8 bytes
    std::uint32_t scope = 0;   ///< of IPv6
    std::uint32_t local = 0;   ///< number of the local socket
    std::uint16_t port = 0;

    /// \param address 127.0.0.1 is 0x7f000001
    [[nodiscard]] static constexpr datagram_path v4(std::uint32_t address, std::uint16_t port,
                                                    std::uint32_t local = 0) noexcept {
        return {.host = v4_prefix | address, .local = local, .port = port};
    }
    [[nodiscard]] static constexpr datagram_path v6(const std::array<std::uint8_t, 16>& address, std::uint16_t port,
                                                    std::uint32_t scope, std::uint32_t local = 0) noexcept {
        return {.network = load_big<8>(address.data()),
                .host = load_big<8>(address.data() + 8),
                .scope = scope,
                .local = local,
                .port = port};
    }
    [[nodiscard]] constexpr bool is_v4() const noexcept { return network == 0 && host >> 32U == v4_prefix >> 32U; }
    [[nodiscard]] constexpr std::uint32_t v4_address() const noexcept { return static_cast<std::uint32_t>(host); }
    [[nodiscard]] constexpr std::array<std::uint8_t, 16> v6_address() const noexcept {
        std::array<std::uint8_t, 16> bytes{};
        store_big<8>(network, bytes.data());
        store_big<8>(host, bytes.data() + 8);
        return bytes;
    }

    bool operator==(const datagram_path&) const = default;

  private:
    static constexpr std::uint64_t v4_prefix = 0xffff00000000;
};

/// A source of datagrams (docs/protocol_security.md, "Datagrams"): where they come from, and which member sends them.
struct datagram_source {
    datagram_path path{};
    std::uint32_t member = 0; ///< its number

    bool operator==(const datagram_source&) const = default;

    struct hash {
        [[nodiscard]] std::size_t operator()(const datagram_source& s) const noexcept {
            constexpr std::uint64_t odd = 0x9e3779b97f4a7c15;
            std::uint64_t mixed = s.path.network * odd + s.path.host;
            mixed = (mixed ^ mixed >> 32U) * odd + (std::uint64_t{s.path.port} << 32U | s.member);
            mixed = (mixed ^ mixed >> 32U) * odd + (std::uint64_t{s.path.scope} << 32U | s.path.local);
            return static_cast<std::size_t>((mixed ^ mixed >> 32U) * odd);
        }
    };
};

} // namespace cles::security
