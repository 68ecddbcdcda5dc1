// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// A numeric IP address: the bytes of an IPv4 address come first, and the rest are zero.
struct ip_address {
    bool is_v6 = false;
    std::array<std::uint8_t, 16> bytes{};

    bool operator==(const ip_address&) const = default;
    /// Its first bits, and zeros behind them.
    [[nodiscard]] ip_address first_bits(unsigned count) const noexcept;
};

/// Reads "10.0.0.1", "fd00::1", "fe80::1%eth0"; nothing where it is something else.
std::optional<ip_address> parse_ip_address(std::string_view text) noexcept;
std::string to_text(const ip_address& address);

/// Whose share of the links an address counts for: a host's; an IPv6 network's of 64 bits, since a host may use all of
/// its addresses. Text that is not an IPv6 address of other hosts stays as it is.
std::string share_of_address(std::string_view text);

/// Networks as they are configured: "10.0.0.0/8", "fd00::/8", or an address alone.
class ip_networks {
  public:
    ip_networks() = default;
    /// \throws cles::error with `invalid_url` where one is not a network
    explicit ip_networks(const std::vector<std::string>& texts);

    /// Whether a numeric address is of one of them.
    [[nodiscard]] bool contain(std::string_view text) const noexcept;

  private:
    struct network {
        ip_address first;
        unsigned bits;
    };
    std::vector<network> all_;
};

} // namespace cles::core
