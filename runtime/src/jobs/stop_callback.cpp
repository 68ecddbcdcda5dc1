// SPDX-License-Identifier: BSL-1.0
#include "jobs/stop_callback.hpp"

#include <mutex>
#include <utility>

namespace cles::runtime {

void stop_callback::set(std::function<void()> callback) {
    {
        const std::lock_guard lock{mutex_};
        if (!stopped()) {
            callback_.swap(callback);
            is_set_.store(true, std::memory_order_release);
            return;
        }
    }
    if (callback) {
        callback();
    }
}

std::function<void()> stop_callback::stop() {
    const std::lock_guard lock{mutex_};
    stopped_.store(true, std::memory_order_release);
    return std::exchange(callback_, nullptr);
}

void stop_callback::drop() {
    if (is_set_.load(std::memory_order_acquire)) {
        std::function<void()> dropped;
        const std::lock_guard lock{mutex_};
        dropped.swap(callback_);
    }
}

void stop_callback::reset() {
    drop();
    stopped_.store(false, std::memory_order_relaxed);
    is_set_.store(false, std::memory_order_relaxed);
}

} // namespace cles::runtime
