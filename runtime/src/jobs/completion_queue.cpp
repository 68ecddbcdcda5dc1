// SPDX-License-Identifier: BSL-1.0
#include "jobs/completion_queue.hpp"

#include <mutex>
#include <thread>
#include <utility>

namespace cles::runtime {

bool result_box::put(item what, bool in_time) {
    bool first = false;
    {
        const std::lock_guard lock{mutex_};
        if (closed_) {
            return false;
        }
        items_.push_back(what);
        first = !in_time && wakes();
    }
    if (first) {
        wake();
    }
    return true;
}

void result_box::flush() {
    bool first = false;
    {
        const std::lock_guard lock{mutex_};
        first = !closed_ && !items_.empty() && wakes();
    }
    if (first) {
        wake();
    }
}

bool result_box::put(errand what) {
    bool first = false;
    {
        const std::lock_guard lock{mutex_};
        if (closed_ || errands_.size() >= most_errands) {
            return false;
        }
        errands_.push_back(std::move(what));
        first = wakes();
    }
    if (first) {
        wake();
    }
    return true;
}

bool result_box::wakes() noexcept {
    if (std::exchange(woken_, true)) {
        return false;
    }
    waking_.fetch_add(1, std::memory_order_relaxed);
    return true;
}

// Without the lock, for it takes long; `close` waits until nobody is here any more.
void result_box::wake() {
    wake_();
    waking_.fetch_sub(1, std::memory_order_release);
}

void result_box::take(std::vector<item>& items, std::vector<errand>& errands) {
    const std::lock_guard lock{mutex_};
    items.swap(items_);
    errands.swap(errands_);
    woken_ = false;
}

void result_box::close(std::vector<item>& items, std::vector<errand>& errands) {
    {
        const std::lock_guard lock{mutex_};
        closed_ = true;
        items.swap(items_);
        errands.swap(errands_);
    }
    while (waking_.load(std::memory_order_acquire) != 0) {
        std::this_thread::yield();
    }
}

} // namespace cles::runtime
