// SPDX-License-Identifier: BSL-1.0
#include "node/base/completion_drain.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

void completion_drain::put(completion due) {
    due_.push_back(std::move(due));
    post();
}

void completion_drain::post() {
    if (!std::exchange(is_posted_, true)) {
        environment_->post(shared_from_this());
    }
}

void completion_drain::run() {
    is_posted_ = false;
    // At least all that are due now: otherwise a function that puts several each time would outpace the queue.
    for (auto left = std::max(max_at_once, due_.size()); left != 0 && !due_.empty(); --left) {
        auto next = std::move(due_.front());
        due_.pop_front();
        if (!due_.empty()) {
            post();
        }
        next();
    }
}

void completion_drain::discard() noexcept {
    is_posted_ = false; // destructors may put more, which are posted and discarded in turn
    const auto discarded = std::exchange(due_, {});
}

} // namespace cles::core
