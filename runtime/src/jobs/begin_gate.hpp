// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstdint>

namespace cles::runtime {

/// Decides when jobs may begin. While the executor's loop waits, requesters may withdraw their jobs: the process or the
/// machine was suspended, a handler blocked the loop, or there was nothing to do. So after a wait of more than
/// `max_wait`, no job begins until what waits in the sockets has been read: until some rounds of the loop, each of
/// which looks for input, have brought neither a job nor a withdrawal. Sans-I/O.
class begin_gate {
  public:
    static constexpr unsigned quiet_rounds = 16;
    static constexpr std::chrono::milliseconds max_reading{50}; ///< however much input there is

    /// \param max_wait zero: jobs may always begin
    explicit begin_gate(std::chrono::nanoseconds max_wait) noexcept;

    /// The loop runs, and a job has arrived or is waiting. True: it has waited for too long. Then no job may begin, and
    /// rounds of the loop have to follow until `end_round` returns true.
    [[nodiscard]] bool begin_round(time_point now) noexcept;
    /// Input has brought a job, or withdrawn one.
    void count_input() noexcept { ++inputs_; }
    /// A round of the loop has ended. True: jobs may begin.
    [[nodiscard]] bool end_round(time_point now) noexcept;

    /// Whether a job may begin now, also at another node.
    [[nodiscard]] bool is_open(time_point now) const noexcept { return !closed_ && now <= open_until_; }
    /// Whether input is being read.
    [[nodiscard]] bool is_closed() const noexcept { return closed_; }
    /// Until when jobs may begin, unless the loop runs before.
    [[nodiscard]] time_point open_until() const noexcept { return open_until_; }

  private:
    void begin_reading(time_point now) noexcept;

    std::chrono::nanoseconds max_wait_;
    time_point open_until_;
    bool closed_ = false;
    time_point reading_since_{};
    time_point last_round_{};
    unsigned quiet_ = 0;
    std::uint64_t inputs_ = 0;
    std::uint64_t inputs_before_ = 0; // the round
};

} // namespace cles::runtime
