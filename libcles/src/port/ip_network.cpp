// SPDX-License-Identifier: BSL-1.0
#include "port/ip_network.hpp"

#include <cles/error.hpp>

#include "protocol/grammar.hpp"

#include <algorithm>
#include <cstddef>

#include <arpa/inet.h>

namespace cles::core {
namespace {

constexpr unsigned bits_of_v4 = 32;
constexpr unsigned bits_of_v6 = 128;

bool is_mapped_v4(const ip_address& a) noexcept {
    return std::all_of(a.bytes.begin(), a.bytes.begin() + 10, [](auto byte) { return byte == 0; }) &&
           a.bytes[10] == 0xFF && a.bytes[11] == 0xFF;
}

bool is_loopback_v6(const ip_address& a) noexcept {
    return std::all_of(a.bytes.begin(), a.bytes.end() - 1, [](auto byte) { return byte == 0; }) && a.bytes[15] == 1;
}

bool is_link_local_v6(const ip_address& a) noexcept { return a.bytes[0] == 0xFE && (a.bytes[1] & 0xC0U) == 0x80; }

// The prefix length after the slash; nothing if it is not a number in range.
std::optional<unsigned> parse_bits(std::string_view text, unsigned most) noexcept {
    if (text.size() > 3) {
        return {};
    }
    const auto bits = protocol::number_between(text, 0, most);
    return bits ? std::optional{static_cast<unsigned>(*bits)} : std::nullopt;
}

} // namespace

ip_address ip_address::first_bits(unsigned count) const noexcept {
    auto result = *this;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        const auto before = static_cast<unsigned>(i) * 8;
        const auto kept = count > before ? std::min(count - before, 8U) : 0;
        result.bytes[i] &= static_cast<std::uint8_t>(0xFF00U >> kept);
    }
    return result;
}

std::optional<ip_address> parse_ip_address(std::string_view text) noexcept {
    std::array<char, INET6_ADDRSTRLEN> terminated{};
    const bool is_v6 = text.find(':') != std::string_view::npos;
    if (is_v6) {
        text = text.substr(0, text.find('%')); // the scope is not a part of the address
    }
    if (text.size() >= terminated.size()) {
        return {};
    }
    std::copy(text.begin(), text.end(), terminated.begin());
    ip_address read{.is_v6 = is_v6};
    if (::inet_pton(is_v6 ? AF_INET6 : AF_INET, terminated.data(), read.bytes.data()) != 1) {
        return {};
    }
    return read;
}

std::string to_text(const ip_address& address) {
    std::array<char, INET6_ADDRSTRLEN> text{};
    return ::inet_ntop(address.is_v6 ? AF_INET6 : AF_INET, address.bytes.data(), text.data(), text.size());
}

std::string share_of_address(std::string_view text) {
    constexpr unsigned of_a_host = 64;
    const auto address = parse_ip_address(text);
    if (!address || !address->is_v6 || is_loopback_v6(*address) || is_link_local_v6(*address) ||
        is_mapped_v4(*address)) {
        return std::string{text};
    }
    return to_text(address->first_bits(of_a_host)) + "/" + std::to_string(of_a_host);
}

ip_networks::ip_networks(const std::vector<std::string>& texts) {
    for (const std::string_view text : texts) {
        const auto slash = text.find('/');
        const auto first = parse_ip_address(text.substr(0, slash));
        const auto most = first && first->is_v6 ? bits_of_v6 : bits_of_v4;
        const auto bits = slash == std::string_view::npos ? most : parse_bits(text.substr(slash + 1), most);
        if (!first || !bits) {
            throw error(errc::invalid_url,
                        "'" + std::string{text} + "' is not a network such as 10.0.0.0/8 or fd00::/8");
        }
        all_.push_back({first->first_bits(*bits), *bits});
    }
}

bool ip_networks::contain(std::string_view text) const noexcept {
    const auto address = parse_ip_address(text);
    return address && std::any_of(all_.begin(), all_.end(), [&](const network& n) {
               return n.first.is_v6 == address->is_v6 && address->first_bits(n.bits) == n.first;
           });
}

} // namespace cles::core
