// SPDX-License-Identifier: BSL-1.0
#include "jobs/completion_queue.hpp"

#include <limits>
#include <thread>
#include <utility>

namespace cles::runtime {

bool completion_queue::push(entry what, bool deferred) {
    std::unique_lock lock{mutex_};
    if (closed_) {
        return false;
    }
    entries_.push_back(what);
    if (!deferred) {
        wake(lock);
    }
    return true;
}

void completion_queue::flush() {
    std::unique_lock lock{mutex_};
    if (!closed_ && !entries_.empty()) {
        wake(lock);
    }
}

bool completion_queue::post(function what) { return post(std::move(what), max_functions); }

bool completion_queue::post_always(function what) {
    return post(std::move(what), std::numeric_limits<std::size_t>::max());
}

bool completion_queue::post(function what, std::size_t most) {
    std::unique_lock lock{mutex_};
    if (closed_ || functions_.size() >= most) {
        return false;
    }
    functions_.push_back(std::move(what));
    wake(lock);
    return true;
}

// Once until `take`. Unlocks, because waking takes long; `close` waits until no thread is in it.
void completion_queue::wake(std::unique_lock<adaptive_mutex>& lock) {
    if (std::exchange(woken_, true)) {
        return;
    }
    wakers_.fetch_add(1, std::memory_order_relaxed);
    lock.unlock();
    wake_();
    wakers_.fetch_sub(1, std::memory_order_release);
}

void completion_queue::take(std::vector<entry>& entries, std::vector<function>& functions) {
    const std::lock_guard lock{mutex_};
    entries.swap(entries_);
    functions.swap(functions_);
    woken_ = false;
}

void completion_queue::close(std::vector<entry>& entries, std::vector<function>& functions) {
    {
        const std::lock_guard lock{mutex_};
        closed_ = true;
        entries.swap(entries_);
        functions.swap(functions_);
    }
    while (wakers_.load(std::memory_order_acquire) != 0) {
        std::this_thread::yield();
    }
}

} // namespace cles::runtime
