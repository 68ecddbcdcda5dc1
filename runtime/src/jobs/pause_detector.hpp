// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <boost/asio/any_io_executor.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>

namespace cles::runtime {

class worker_pool;
struct pool_options;

/// Detects that the service's executor did not run for some time, because the process or the machine was suspended, or
/// a handler blocked the executor. Requesters may have withdrawn in the meantime, in input that has not been read. So
/// no job starts until that input has been read. Used on the executor.
class pause_detector {
  public:
    /// \param executor not used after `close` \param on_pause called with the least duration of a pause
    pause_detector(const boost::asio::any_io_executor& executor, worker_pool& workers, const pool_options& options,
                   std::function<void(std::chrono::nanoseconds)> on_pause);
    pause_detector(const pause_detector&) = delete;
    pause_detector& operator=(const pause_detector&) = delete;
    ~pause_detector() = default;

    /// To be called first. \param self keeps this alive while a posted function uses it
    void start(std::weak_ptr<pause_detector> self) { self_ = std::move(self); }
    /// The pool's timer has been armed: if it runs much later, there was a pause.
    void expect_timer(std::chrono::milliseconds interval);
    /// Pauses the workers if the timer is late.
    void detect();
    /// The same, and wakes the workers if they are not paused: one that has found the executor late waits for that,
    /// even if the pause has ended before the worker reports it.
    void check();
    /// A job has arrived or has been stopped.
    void count_input() noexcept { ++inputs_; }
    void close() noexcept { closed_ = true; }

  private:
    void update_executor_due();
    void post_round();
    void run_round();

    const boost::asio::any_io_executor& executor_;
    worker_pool& workers_;
    const pool_options& options_;
    std::function<void(std::chrono::nanoseconds)> on_pause_;
    std::weak_ptr<pause_detector> self_;
    std::chrono::milliseconds interval_{0}; // of the timer
    bool closed_ = false;

    // While the input that arrived during a pause is read:
    bool recovering_ = false;
    time_point recovery_began_;
    unsigned quiet_rounds_ = 0;
    std::uint64_t inputs_ = 0;
    std::uint64_t inputs_last_round_ = 0;
};

} // namespace cles::runtime
