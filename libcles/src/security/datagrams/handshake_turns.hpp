// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/shared_turns.hpp"
#include "security/datagrams/datagram_path.hpp"

#include <algorithm>
#include <cstdint>

namespace cles::security {

/// Turns that are counted by member. Only what a member has made is charged to it.
using member_turns = core::shared_turns<std::uint32_t>;
/// By address, of which senders of datagrams can state any.
using address_turns = core::shared_turns<std::uint64_t>;

/// At most so many turns in any second: half of them for the shares of members, the other half for those who need more.
[[nodiscard]] constexpr member_turns::bounds member_bounds(std::uint32_t per_second, core::turn_rate share) {
    const auto half = per_second / 2;
    const auto rate = [half](std::uint32_t at_once) {
        return core::turn_rate{.per_second = std::max(half - at_once, 1U), .at_once = std::max(at_once, 1U)};
    };
    return {.share = share, .shares = rate(half / 5), .common = rate(half / 10)};
}

/// What the turns of a host, or of an IPv6 network of 64 bits, are counted by.
[[nodiscard]] constexpr std::uint64_t share_of(const datagram_path& path) noexcept {
    constexpr std::uint64_t link_local = 0xfe80000000000000;
    return path.network == 0 || path.network == link_local ? path.host : path.network;
}

} // namespace cles::security
