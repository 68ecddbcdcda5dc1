// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <condition_variable>
#include <mutex>

namespace cles::test {

/// Blocks jobs on other threads until the test opens it.
class gate {
  public:
    gate() = default;
    gate(const gate&) = delete;
    gate& operator=(const gate&) = delete;
    ~gate() = default;

    /// Waits until it is open.
    void pass() {
        std::unique_lock lock{mutex_};
        ++arrived_;
        changed_.wait(lock, [this] { return open_; });
        ++passed_;
    }
    void open() {
        const std::lock_guard lock{mutex_};
        open_ = true;
        changed_.notify_all();
    }
    /// How many have arrived so far.
    [[nodiscard]] int arrived() const {
        const std::lock_guard lock{mutex_};
        return arrived_;
    }
    [[nodiscard]] int passed() const {
        const std::lock_guard lock{mutex_};
        return passed_;
    }

  private:
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    bool open_ = false;
    int arrived_ = 0;
    int passed_ = 0;
};

} // namespace cles::test
