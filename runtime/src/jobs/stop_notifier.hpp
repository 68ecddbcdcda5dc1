// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

namespace cles::runtime {

/// Makes the `on_stop` calls of jobs, one after another, on a thread that does nothing else: neither the node nor a
/// worker waits for a callback.
///
/// A callback that takes longer than `patience` (less if others block already) is reported, and another thread
/// continues with the next one. There are at most `max_threads`; when all are blocked, which is also reported, the
/// remaining calls wait until one returns. The first thread is started for the first call, a second one when a call has
/// to wait.
class stop_notifier {
  public:
    struct notice {
        std::function<void()> callback; ///< exceptions are logged
        /// May be called on any thread, while the callback runs and after it has returned.
        std::function<void(log_level, const std::string&)> log{};
    };

    static constexpr std::size_t max_threads = 16;
    /// How long `close` waits, whatever the limit, for a call that is not known to block: enough for a thread to start
    /// and to go from one call to the next.
    static constexpr std::chrono::milliseconds min_close_time{500};

    explicit stop_notifier(std::chrono::milliseconds patience = std::chrono::milliseconds{10});
    stop_notifier(const stop_notifier&) = delete;
    stop_notifier& operator=(const stop_notifier&) = delete;
    ~stop_notifier();

    /// From any thread. False after `close`: the callback is not called.
    bool notify(notice what);
    /// Waits until all callbacks have returned: no longer than the limit for those that are known to block, and at
    /// least `min_close_time` for the others, because a call that is running when the limit passes seldom hangs. Calls
    /// that have not begun by then are dropped. Returns how many threads are abandoned.
    std::size_t close(std::chrono::milliseconds limit);

  private:
    struct state;

    std::shared_ptr<state> state_; // shared with the threads, which may be abandoned
};

} // namespace cles::runtime
