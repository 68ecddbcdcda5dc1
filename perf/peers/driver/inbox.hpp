// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/fan_out/fan_out.hpp"

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <mutex>
#include <vector>

namespace cles::perf::peers {

/// Collects what all subscribers receive, on any thread.
class inbox {
  public:
    explicit inbox(std::size_t subscribers) : reached_(subscribers) {}

    /// Safe on any thread. Before `begin` it only marks this subscriber as reached; afterwards, earlier publications do
    /// not count.
    void take(std::size_t subscriber, const publication& value);
    /// `wait_for` and `look` throw this exception.
    void fail(std::exception_ptr why);

    /// Every subscriber has received something.
    [[nodiscard]] bool all_reached();
    void begin(const fan_out_order& order, latency_recorder* record);
    /// How many have arrived since, and whether that is all.
    struct state {
        std::uint64_t count = 0;
        bool complete = false;
    };
    state look();
    /// Waits until all subscribers are reached, or all has arrived, but no longer than this.
    void wait_for(std::chrono::milliseconds at_most);
    fan_out_tally tally();

  private:
    [[nodiscard]] bool settled() const;
    void throw_failure() const;

    std::mutex guard_;
    std::condition_variable news_;
    std::vector<bool> reached_;
    std::size_t reached_count_ = 0;
    arrivals arrivals_{nullptr};
    std::uint64_t expected_ = 0;
    std::int64_t began_ = 0;
    bool counting_ = false;
    std::exception_ptr failure_;
};

} // namespace cles::perf::peers
