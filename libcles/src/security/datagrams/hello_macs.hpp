// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_format.hpp"
#include "security/fleet/fleet.hpp"
#include "security/keys/secret.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstdint>

namespace cles::security {

/// The MAC at the end of HELLO (docs/protocol_security.md, "Between two nodes"). It shows at the cost of a hash that a
/// member has made this HELLO, but not when: anybody can repeat it.
class hello_macs {
  public:
    explicit hello_macs(const fleet& of) noexcept : fleet_(of) {}

    /// Of a HELLO of this node to that member. \pre this node is a member
    [[nodiscard]] hello_mac make(const member& to, bytes_view hello);
    /// Whether that member has made the MAC of its HELLO to this node. \pre this node is a member
    [[nodiscard]] bool verify(const member& from, bytes_view hello, bytes_view mac);

    /// Wipes what was kept of a member.
    void forget(std::uint32_t member) { agreed_.erase(member); }
    void clear() { agreed_.clear(); }

  private:
    /// The secret that two members agree on is of use for more than MACs, so only the keys are kept.
    struct mac_keys {
        agreement_key peer{};
        std::uint32_t own = 0; // number
        secret_bytes both;     // for what this node sends, and for what that member does; empty: none can be agreed on
    };

    [[nodiscard]] const secret_bytes& agree(const member& with);

    const fleet& fleet_;
    boost::unordered_flat_map<std::uint32_t, mac_keys> agreed_; // so that each HELLO does not cost an agreement
};

} // namespace cles::security
