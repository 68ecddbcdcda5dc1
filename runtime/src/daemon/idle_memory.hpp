// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>

namespace cles::runtime {

/// What a process uses of the system.
struct process_usage {
    std::uint64_t resident = 0;          ///< bytes
    std::uint64_t unused = 0;            ///< bytes that were freed, and that the C library keeps
    std::chrono::nanoseconds cpu_time{}; ///< of all threads, so far
};

/// Of this process. What the system or the C library does not tell is 0.
process_usage usage_of_process();

/// From now on, the C library returns blocks of more than 256 KiB to the system when they are freed, and keeps at most
/// half a megabyte at the end of a thread's heap. By default, it raises both to what was freed once, and nothing
/// returns what it keeps there after a large message. What the environment states (GLIBC_TUNABLES, MALLOC_...) counts
/// instead.
void keep_little_memory() noexcept;

/// Returns to the system what the C library keeps, except for the end of the heaps of other threads.
void return_unused_memory() noexcept;

/// Decides when a process returns unused memory to the system. Sans-I/O.
///
/// The C library returns little more than the end of a heap. What a large message has taken is mostly not there, so it
/// stays resident after the link has freed it. Returning all of it delays other threads that need memory for a moment,
/// and the next large message has to get it again, so it is done when the process is idle, and if there is enough.
class idle_memory {
  public:
    static constexpr std::chrono::seconds interval{5};
    /// A process that has used more processor time in an interval is not idle.
    static constexpr std::chrono::milliseconds idle_cpu_time{250};
    static constexpr std::uint64_t enough = std::uint64_t{1} << 20U; ///< bytes

    explicit idle_memory(const process_usage& now) noexcept : known_(now) {}

    /// To be asked once for each interval. If it is time, `returned` follows.
    [[nodiscard]] bool is_time(const process_usage& now) noexcept;
    /// \param now what the process uses since
    void returned(const process_usage& now) noexcept { known_ = now; }

  private:
    process_usage known_; // the processor time at the last interval, the memory when it was returned
};

} // namespace cles::runtime
