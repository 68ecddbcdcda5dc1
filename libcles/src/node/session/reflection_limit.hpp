// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/string_map.hpp"

#include <cstddef>
#include <string_view>

namespace cles::core {

/// Limits what a node sends to an unverified address to less than 64 KiB in any second, so that a forged source address
/// cannot be used to flood its owner.
///
/// An address is one host, whatever the port. Each has a bucket of 16 KiB that fills at 44 KiB a second. The rest is a
/// margin for the network, where datagrams may bunch up.
class reflection_limit {
  public:
    static constexpr std::size_t bytes_per_second = 44U * 1024U;
    static constexpr std::size_t at_once = 16U * 1024U;
    static constexpr std::size_t max_addresses = 16384;

    /// Whether a datagram of this size may be sent there; if so, it counts as sent.
    bool admit(std::string_view address, std::size_t bytes, time_point now);
    [[nodiscard]] std::size_t addresses() const noexcept { return buckets_.size(); }

  private:
    struct bucket {
        double room = static_cast<double>(at_once);
        time_point at{};
    };

    static void fill(bucket& b, time_point now) noexcept;
    bucket* find_or_make(std::string_view address, time_point now);
    void forget_full(time_point now);

    string_map<bucket> buckets_;
    time_point tidied_{};
};

} // namespace cles::core
