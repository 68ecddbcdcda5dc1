// SPDX-License-Identifier: BSL-1.0
#include "jobs/completion_queue.hpp"

#include <mutex>
#include <thread>
#include <utility>

namespace cles::runtime {

bool completion_queue::push(entry what, bool deferred) {
    bool first = false;
    {
        const std::lock_guard lock{mutex_};
        if (closed_) {
            return false;
        }
        entries_.push_back(what);
        first = !deferred && needs_wake();
    }
    if (first) {
        wake();
    }
    return true;
}

void completion_queue::flush() {
    bool first = false;
    {
        const std::lock_guard lock{mutex_};
        first = !closed_ && !entries_.empty() && needs_wake();
    }
    if (first) {
        wake();
    }
}

bool completion_queue::post(function what) {
    bool first = false;
    {
        const std::lock_guard lock{mutex_};
        if (closed_ || functions_.size() >= max_functions) {
            return false;
        }
        functions_.push_back(std::move(what));
        first = needs_wake();
    }
    if (first) {
        wake();
    }
    return true;
}

bool completion_queue::needs_wake() noexcept {
    if (std::exchange(woken_, true)) {
        return false;
    }
    wakers_.fetch_add(1, std::memory_order_relaxed);
    return true;
}

// Runs without the lock, because it takes long; `close` waits until no thread is in it.
void completion_queue::wake() {
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
