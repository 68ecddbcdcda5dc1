// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>

namespace cles {

/// While it exists, asks the kernel to limit the idle states of all cores of this host to those from which waking takes
/// at most a given time; with zero, to avoid idle states as far as possible. Waiting threads then react sooner and with
/// less jitter, but idle cores save less power. This affects all programs of the host; of several limits, the least
/// applies.
///
/// The kernel uses the wake-up times reported by the driver of its idle states
/// (/sys/devices/system/cpu/cpu0/cpuidle/state*/latency). In a virtual machine, they do not include what the host of
/// the machine adds, so only zero helps there. Without such a driver, it has no effect.
///
/// May be created and destroyed on any thread. See PM Quality of Service in the Linux kernel's documentation.
class wake_bound {
  public:
    /// \param longest time to wake; values below zero count as zero, values beyond the kernel's maximum (about 35
    /// minutes) as that maximum
    /// \throws std::system_error if the system refuses: write access to /dev/cpu_dma_latency is required
    explicit wake_bound(std::chrono::microseconds longest);
    wake_bound(const wake_bound&) = delete;
    wake_bound& operator=(const wake_bound&) = delete;
    ~wake_bound();

  private:
    int device_;
};

} // namespace cles
