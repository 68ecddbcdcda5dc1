// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

namespace cles::runtime {

/// Calls what jobs want to be called when they are stopped, one call after another, on a thread that does nothing else:
/// neither the node nor a worker waits for what a job does then.
///
/// A call that takes longer than it should (`patience`, less where others block already) is reported, and another
/// thread takes the place of the one that it blocks, so that it holds up nobody else. There are at most `most_threads`;
/// when all of them are blocked, which is reported too, what waits is called when one comes back. The first thread is
/// started for the first call, a second one when a call has to wait.
class stop_notifier {
  public:
    struct notice {
        std::function<void()> callback; ///< what it throws is logged
        /// May be called on any thread, also while the callback runs and after it has returned.
        std::function<void(log_level, const std::string&)> log{};
    };

    static constexpr std::size_t most_threads = 16;
    /// How long `end` waits at least for a call that is not known to block, whatever the limit: what a thread has to
    /// begin and to go from one call to the next.
    static constexpr std::chrono::milliseconds last_moment{500};

    explicit stop_notifier(std::chrono::milliseconds patience = std::chrono::milliseconds{10});
    stop_notifier(const stop_notifier&) = delete;
    stop_notifier& operator=(const stop_notifier&) = delete;
    ~stop_notifier();

    /// From any thread. False after `end`: it is not called.
    bool notify(notice what);
    /// Waits until all calls have been made and have returned. For calls that are known to block it waits no longer
    /// than the limit; for the others `last_moment` at least, since a call that is under way when the limit passes is
    /// seldom one that hangs. What has not been called by then never is; nothing of it is held. Returns how many
    /// threads are left behind.
    std::size_t end(std::chrono::milliseconds limit);

  private:
    struct inside;

    std::shared_ptr<inside> inside_; // the threads' too, which may be left behind
};

} // namespace cles::runtime
