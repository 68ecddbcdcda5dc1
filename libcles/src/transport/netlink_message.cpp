// SPDX-License-Identifier: BSL-1.0
#include "transport/netlink_message.hpp"

#include <algorithm>
#include <cstring>

namespace cles::transport {
namespace {

bool is_of_interface(std::uint16_t type) noexcept {
    return type == netlink_type::new_link || type == netlink_type::deleted_link || type == netlink_type::new_address ||
           type == netlink_type::deleted_address;
}

} // namespace

// Only the heads are read: the interfaces are listed anew after each report.
bool may_report_interface(std::span<const std::byte> messages) noexcept {
    constexpr auto alignment = netlink_alignment;
    while (!messages.empty()) {
        netlink_head head;
        if (messages.size() < sizeof head) {
            return true;
        }
        std::memcpy(&head, messages.data(), sizeof head);
        const std::size_t length = head.length;
        if (length < sizeof head || length > messages.size() || is_of_interface(head.type)) {
            return true;
        }
        const auto padded = (length + alignment - 1) / alignment * alignment; // the last may lack its padding
        messages = messages.subspan(std::min(padded, messages.size()));
    }
    return false;
}

} // namespace cles::transport
