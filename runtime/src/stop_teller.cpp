// SPDX-License-Identifier: BSL-1.0
#include "stop_teller.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace cles::runtime {
namespace {

// What the thread has to begin and to go from one to the next, whatever the limit.
constexpr std::chrono::milliseconds last_turn{500};

} // namespace

// What is posted to the thread holds nothing of a job: it would be kept when the thread runs nothing more, and with it
// the pool that holds the thread.
struct stop_teller::waiting {
    struct told {
        job_context job;
        std::function<void()> callback;
    };

    std::mutex mutex;
    std::condition_variable changed;
    std::deque<told> all;
    bool telling = false;

    void tell_next() {
        std::optional<told> next;
        {
            const std::lock_guard lock{mutex};
            if (all.empty()) {
                return;
            }
            next.emplace(std::move(all.front()));
            all.pop_front();
            telling = true;
        }
        try {
            next->callback();
        } catch (...) {
            next->job.log(log_level::warning, "a job threw when it was told to stop");
        }
        next.reset();
        const std::lock_guard lock{mutex};
        telling = false;
        changed.notify_all();
    }
};

stop_teller::stop_teller() : waiting_(std::make_shared<waiting>()) {}

stop_teller::~stop_teller() = default;

void stop_teller::tell(job_context job, std::function<void()> callback) {
    if (!thread_) {
        thread_ = std::make_unique<worker_threads>(1);
    }
    {
        const std::lock_guard lock{waiting_->mutex};
        waiting_->all.push_back({std::move(job), std::move(callback)});
    }
    boost::asio::post(thread_->get_executor(), [list = waiting_] { list->tell_next(); });
}

std::size_t stop_teller::end(std::chrono::milliseconds limit) {
    if (!thread_) {
        return 0;
    }
    const auto end = std::chrono::steady_clock::now() + limit;
    std::deque<waiting::told> never;
    std::size_t busy = 0;
    {
        std::unique_lock lock{waiting_->mutex};
        auto& w = *waiting_;
        w.changed.wait_for(lock, std::max(limit, last_turn), [&] { return w.all.empty() && !w.telling; });
        never.swap(w.all);
        busy = w.telling ? 1 : 0;
    }
    never.clear();
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    return thread_->stop(std::max(left, std::chrono::milliseconds{0}), busy);
}

} // namespace cles::runtime
