// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "jobs/begin_gate.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <chrono>
#include <functional>
#include <memory>
#include <utility>

namespace cles::runtime {

class worker_pool;
struct pool_options;

/// Does what `begin_gate` decides: after the service's executor has waited for some time, no worker starts a job until
/// the input that arrived has been read. Reports waits that are pauses: the process or the machine was suspended, or a
/// handler blocked the executor. Used on the executor.
class pause_detector {
  public:
    /// \param executor not used after `close` \param on_pause called with the least duration of a pause
    pause_detector(const boost::asio::any_io_executor& executor, worker_pool& workers, const pool_options& options,
                   std::function<void(std::chrono::nanoseconds)> on_pause);
    pause_detector(const pause_detector&) = delete;
    pause_detector& operator=(const pause_detector&) = delete;
    ~pause_detector() = default;

    /// To be called first. \param self keeps this alive while a posted function uses it \param on_read called when
    /// input has been read, and jobs may start
    void start(std::weak_ptr<pause_detector> self, std::function<void()> on_read) {
        self_ = std::move(self);
        on_read_ = std::move(on_read);
    }
    /// The pool's timer has been armed: if it runs much later, there was a pause.
    void expect_timer(std::chrono::milliseconds interval);
    /// The executor runs. Reports a pause if the timer is late.
    void report();
    /// The same, and a job has arrived: pauses the workers if it may not start yet.
    void detect();
    /// The same for jobs that wait, and wakes the workers if they are not paused: one that has found the executor late
    /// waits for that, even if the pause has ended before the worker reports it.
    void check();
    /// A job has arrived or has been stopped.
    void count_input() noexcept { gate_.count_input(); }
    [[nodiscard]] bool may_start() const noexcept { return gate_.is_open(time_point::clock::now()); }
    void close() noexcept { closed_ = true; }

  private:
    void post_round();
    void run_round();

    const boost::asio::any_io_executor& executor_;
    worker_pool& workers_;
    const pool_options& options_;
    std::function<void(std::chrono::nanoseconds)> on_pause_;
    std::function<void()> on_read_;
    std::weak_ptr<pause_detector> self_;
    begin_gate gate_;
    std::chrono::milliseconds interval_{0}; // of the timer
    time_point timer_due_ = time_point::max();
    bool closed_ = false;
};

} // namespace cles::runtime
