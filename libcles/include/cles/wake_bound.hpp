// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>

namespace cles {

/// Asks the kernel, for as long as it lives, to let no core of this host sleep deeper than it wakes from within a time;
/// with zero, to let none sleep where it can do without. What waits is then answered sooner and at a steadier pace, for
/// the power that idle cores save otherwise. It holds for all programs of the host; of several bounds the least counts.
///
/// The kernel goes by what the driver of its idle states says that waking takes
/// (/sys/devices/system/cpu/cpu0/cpuidle/state*/latency): for a virtual machine, that leaves out what the host of the
/// machine adds, so that only zero helps there; without such a driver nothing does.
///
/// Any thread may make and end it. See the Linux kernel's documentation of PM Quality of Service.
class wake_bound {
  public:
    /// Less than zero counts as zero, more than the kernel takes (some 35 minutes) as that.
    /// \throws std::system_error where the system refuses: it takes the right to write to /dev/cpu_dma_latency
    explicit wake_bound(std::chrono::microseconds longest);
    wake_bound(const wake_bound&) = delete;
    wake_bound& operator=(const wake_bound&) = delete;
    ~wake_bound();

  private:
    int device_;
};

} // namespace cles
