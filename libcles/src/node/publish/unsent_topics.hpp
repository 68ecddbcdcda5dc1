// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/publish/topic.hpp"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

namespace cles::core {

/// The topics with updates that have not been sent to their subscribers. `flush_scheduler` sends them.
class unsent_topics {
  public:
    /// `wake` is called for the first topic after each `take`.
    explicit unsent_topics(std::function<void()> wake) : wake_(std::move(wake)) {}
    unsent_topics(const unsent_topics&) = delete;
    unsent_topics& operator=(const unsent_topics&) = delete;

    /// The topic has a new update. Does nothing if nobody is bound to it.
    void mark(topic& t) {
        if (!t.is_bound()) {
            return;
        }
        ++updates_;
        if (std::find(topics_.begin(), topics_.end(), &t) == topics_.end()) {
            topics_.push_back(&t);
            if (topics_.size() == 1) {
                wake_();
            }
        }
    }
    /// The topic is to be destroyed.
    void forget(topic& t) { std::erase(topics_, &t); }
    [[nodiscard]] bool empty() const noexcept { return topics_.empty(); }
    /// The number of updates so far, including those that have been sent.
    [[nodiscard]] std::uint64_t updates() const noexcept { return updates_; }

    /// Removes and returns all topics. Give the list to `reuse` afterwards, for its capacity.
    [[nodiscard]] std::vector<topic*> take() noexcept { return std::exchange(topics_, std::exchange(spare_, {})); }
    void reuse(std::vector<topic*> list) noexcept {
        list.clear();
        spare_ = std::move(list);
    }

  private:
    std::function<void()> wake_;
    std::vector<topic*> topics_;
    std::vector<topic*> spare_; // empty
    std::uint64_t updates_ = 0;
};

} // namespace cles::core
