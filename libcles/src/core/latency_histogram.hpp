// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace cles::core {

/// Counts durations in buckets that grow with them (eight to each doubling, so a quantile is right to 12.5 %).
class latency_histogram {
  public:
    void record(std::chrono::nanoseconds duration) noexcept {
        const auto ns = duration.count() < 0 ? 0U : static_cast<std::uint64_t>(duration.count());
        ++buckets_[bucket_of(ns)];
        ++count_;
    }

    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

    /// The upper bound of the bucket that holds the quantile, the least duration that so large a share does not exceed;
    /// 0 where nothing was recorded.
    [[nodiscard]] std::chrono::nanoseconds quantile(double q) const noexcept {
        const auto wanted = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(count_)));
        std::uint64_t seen = 0;
        for (std::size_t i = 0; i < buckets_.size(); ++i) {
            seen += buckets_[i];
            if (buckets_[i] != 0 && seen >= wanted) {
                return std::chrono::nanoseconds{upper_bound(i)};
            }
        }
        return {};
    }

  private:
    static constexpr unsigned sub_bits = 3;
    static constexpr std::size_t sub = 1U << sub_bits;

    static constexpr std::size_t bucket_of(std::uint64_t ns) noexcept {
        if (ns < sub) {
            return static_cast<std::size_t>(ns);
        }
        const auto shift = static_cast<unsigned>(std::bit_width(ns)) - 1 - sub_bits;
        const auto index = (static_cast<std::size_t>(shift) + 1) * sub + ((ns >> shift) & (sub - 1));
        return index < bucket_count ? index : bucket_count - 1;
    }
    static constexpr std::int64_t upper_bound(std::size_t index) noexcept {
        if (index < sub) {
            return static_cast<std::int64_t>(index);
        }
        const auto shift = index / sub - 1;
        return static_cast<std::int64_t>(((sub + index % sub + 1) << shift) - 1);
    }

    static constexpr std::size_t bucket_count = 40 * sub; // up to about an hour
    std::array<std::uint64_t, bucket_count> buckets_{};
    std::uint64_t count_ = 0;
};

} // namespace cles::core
