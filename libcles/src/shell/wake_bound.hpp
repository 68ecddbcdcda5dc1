// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>

namespace cles::shell {

/// Keeps the cores of this host from sleeping deeper than lets them wake within a time, for as long as it lives. The
/// least bound that any program asks for counts.
/// See: the Linux kernel's documentation of PM Quality of Service, the device /dev/cpu_dma_latency.
class wake_bound {
  public:
    /// \param longest zero: they do not sleep at all, but look for work; it is bounded by 0 and 35 minutes
    /// \throws std::system_error where the system refuses
    explicit wake_bound(std::chrono::microseconds longest);
    wake_bound(const wake_bound&) = delete;
    wake_bound& operator=(const wake_bound&) = delete;
    ~wake_bound();

  private:
    int device_;
};

} // namespace cles::shell
