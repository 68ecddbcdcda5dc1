// SPDX-License-Identifier: BSL-1.0
#include "shell/completion_drain.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <utility>

namespace cles::shell {

/// A function of the executor. Where it is destroyed without a call, because its execution context is, so are the
/// completions: they may own what owns the queue.
class completion_drain::posted {
  public:
    explicit posted(std::shared_ptr<completion_drain> whose) noexcept : whose_(std::move(whose)) {}
    posted(posted&&) noexcept = default;
    posted(const posted&) = delete;
    posted& operator=(const posted&) = delete;
    posted& operator=(posted&&) = delete;
    ~posted() {
        if (whose_) {
            whose_->is_posted_ = false; // what their destructors complete is posted, and discarded in its turn
            const auto discarded = std::exchange(whose_->due_, {});
        }
    }

    void operator()() { std::exchange(whose_, nullptr)->run(); }

  private:
    std::shared_ptr<completion_drain> whose_;
};

void completion_drain::put(core::completion due) {
    due_.push_back(std::move(due));
    post();
}

void completion_drain::post() {
    if (!std::exchange(is_posted_, true)) {
        boost::asio::post(executor_, posted{shared_from_this()});
    }
}

void completion_drain::run() {
    is_posted_ = false;
    // No fewer than there are, or a function that puts more of them each time would never be caught up with.
    for (auto left = std::max(most_at_once, due_.size()); left != 0 && !due_.empty(); --left) {
        auto next = std::move(due_.front());
        due_.pop_front();
        if (!due_.empty()) {
            post();
        }
        next();
    }
}

} // namespace cles::shell
