// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cles::perf {

/// In microseconds.
struct latencies {
    double p50 = 0;
    double p99 = 0;
    double p999 = 0;
    double max = 0;
};

/// Of figures, such as those of several passes. \pre there are some
[[nodiscard]] double median(std::vector<double> of);

/// Stores every latency of one pass, so that its quantiles are exact. Recording neither allocates nor touches new
/// pages.
class latency_recorder {
  public:
    explicit latency_recorder(std::size_t capacity) : nanoseconds_(capacity) {}

    void clear() noexcept { count_ = 0; }
    [[nodiscard]] bool full() const noexcept { return count_ == nanoseconds_.size(); }
    [[nodiscard]] std::size_t count() const noexcept { return count_; }
    [[nodiscard]] std::size_t remaining() const noexcept { return nanoseconds_.size() - count_; }
    /// \pre it is not full
    void record(std::chrono::nanoseconds latency) noexcept {
        nanoseconds_[count_++] = static_cast<std::uint64_t>(latency.count());
    }
    /// Records in `other` what was recorded here, as far as there is space.
    void copy_to(latency_recorder& other) const noexcept;
    /// Reorders what was recorded.
    latencies quantiles();

  private:
    std::vector<std::uint64_t> nanoseconds_;
    std::size_t count_ = 0;
};

} // namespace cles::perf
