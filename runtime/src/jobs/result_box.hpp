// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "jobs/brief_mutex.hpp"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace cles::runtime {

class job_record;

/// What workers and other threads have for the service's executor. The first thing in it wakes the executor, which
/// takes out all that has gathered when it comes.
class result_box {
  public:
    enum class news : std::uint8_t {
        progress,
        ended, ///< there is an answer
        gone,  ///< nobody holds the job any more
    };
    struct item {
        job_record* record; ///< with one reference to it, but for what is gone
        news what;
    };
    using errand = std::function<void()>;

    /// `wake` is called, from any thread, to have `take` called soon.
    explicit result_box(std::function<void()> wake) : wake_(std::move(wake)) {}
    result_box(const result_box&) = delete;
    result_box& operator=(const result_box&) = delete;
    ~result_box() = default;

    /// False once it has been closed. `in_time`: without a wake-up, when the executor comes by anyway.
    [[nodiscard]] bool put(item what, bool in_time = false);
    /// Has what was put in with time fetched now.
    void flush();
    /// Something to be run on the executor. False once it has been closed, or where too many wait.
    [[nodiscard]] bool put(errand what);
    /// Exchanges what is there for two empty lists.
    void take(std::vector<item>& items, std::vector<errand>& errands);
    /// Takes nothing from now on, and hands over what is there. Once it returns, nobody wakes the executor any more.
    void close(std::vector<item>& items, std::vector<errand>& errands);

  private:
    static constexpr std::size_t most_errands = 4096;

    [[nodiscard]] bool wakes() noexcept;
    void wake();

    std::function<void()> wake_;
    brief_mutex mutex_;
    std::vector<item> items_;
    std::vector<errand> errands_;
    std::atomic<int> waking_{0};
    bool woken_ = false;
    bool closed_ = false;
};

} // namespace cles::runtime
