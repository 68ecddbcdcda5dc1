// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/text_map.hpp"

#include <cstddef>
#include <string_view>

namespace cles::core {

/// How much a node sends to an address that nobody has vouched for: less than 64 KiB in any second, so that a forged
/// source address is no way to flood whom it belongs to.
///
/// An address is one host, whatever the port. Each has a bucket that fills at 44 KiB a second and holds 16. The rest is
/// for the way there, on which datagrams draw nearer to each other.
class reflection_limit {
  public:
    static constexpr std::size_t bytes_per_second = 44U * 1024U;
    static constexpr std::size_t at_once = 16U * 1024U;
    static constexpr std::size_t most_addresses = 16384;

    /// Whether a datagram of so many bytes may be sent there. It is then taken for sent.
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

    text_map<bucket> buckets_;
    time_point tidied_{};
};

} // namespace cles::core
