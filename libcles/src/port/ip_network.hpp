// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// A numeric IP address: the bytes of an IPv4 address come first; the rest are zero.
struct ip_address {
    bool is_v6 = false;
    std::array<std::uint8_t, 16> bytes{};

    bool operator==(const ip_address&) const = default;
    /// The first `count` bits, followed by zeros.
    [[nodiscard]] ip_address first_bits(unsigned count) const noexcept;
};

/// Parses "10.0.0.1", "fd00::1", "fe80::1%eth0"; nothing if it is anything else.
std::optional<ip_address> parse_ip_address(std::string_view text) noexcept;
std::string to_text(const ip_address& address);

/// The holder whose share of the links an address counts against: a host, or an IPv6 network of 64 bits, since a host
/// may use all of its addresses. Text that is not an IPv6 address of another host is returned unchanged.
std::string share_of_address(std::string_view text);

/// Networks as configured: "10.0.0.0/8", "fd00::/8", or a single address.
class ip_networks {
  public:
    ip_networks() = default;
    /// \throws cles::error with `invalid_url` if one is not a network
    explicit ip_networks(const std::vector<std::string>& texts);

    /// Whether a numeric address belongs to one of them.
    [[nodiscard]] bool contain(std::string_view text) const noexcept;

  private:
    struct network {
        ip_address first;
        unsigned bits;
    };
    std::vector<network> all_;
};

} // namespace cles::core
