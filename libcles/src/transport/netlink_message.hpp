// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace cles::transport {

// What is needed of netlink(7) and rtnetlink(7): the kernel's headers are not sure to be valid C++.

/// The head of a message; messages begin at multiples of `netlink_alignment`.
struct netlink_head {
    std::uint32_t length = 0; ///< of the message, with its head
    std::uint16_t type = 0;
    std::uint16_t flags = 0;
    std::uint32_t number = 0;
    std::uint32_t port = 0;
};
static_assert(sizeof(netlink_head) == 16);
inline constexpr std::size_t netlink_alignment = 4;

/// The types of messages that report interfaces and their addresses.
namespace netlink_type {
inline constexpr std::uint16_t new_link = 16;
inline constexpr std::uint16_t deleted_link = 17;
inline constexpr std::uint16_t new_address = 20;
inline constexpr std::uint16_t deleted_address = 21;
} // namespace netlink_type

/// Whether what was read from a socket of rtnetlink(7) reports that an interface or an IPv4 address of one has come,
/// changed or gone, or is not well-formed, so that it may have.
[[nodiscard]] bool may_report_interface(std::span<const std::byte> messages) noexcept;

} // namespace cles::transport
