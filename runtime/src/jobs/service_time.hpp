// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>

namespace cles::runtime {

/// How long a job holds a worker, smoothed: each new one counts an eighth, as in TCP's estimate of a round trip
/// (RFC 6298, section 2).
class service_time {
  public:
    void add(std::chrono::nanoseconds took) noexcept {
        const auto ns = took.count() < 0 ? 0 : took.count();
        smoothed_ = known_ ? smoothed_ + (ns - smoothed_) / weight : ns;
        known_ = true;
    }
    /// Zero where there has been none.
    [[nodiscard]] std::chrono::nanoseconds value() const noexcept { return std::chrono::nanoseconds{smoothed_}; }

  private:
    static constexpr std::int64_t weight = 8;

    std::int64_t smoothed_ = 0;
    bool known_ = false;
};

} // namespace cles::runtime
