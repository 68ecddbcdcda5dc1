// SPDX-License-Identifier: BSL-1.0
#include "asio/cross_thread_updates.hpp"

#include <boost/asio/post.hpp>

namespace cles::asio_port {

void cross_thread_updates::publish(std::string_view noun, std::string_view json) {
    const std::scoped_lock lock{mutex_};
    if (closed_) {
        return;
    }
    waiting_.emplace_back(noun, json);
    bytes_ += size_of(waiting_.back());
    while (waiting_.size() - first_ > max_waiting || (bytes_ > max_bytes && waiting_.size() - first_ > 1)) {
        auto& oldest = waiting_[first_++];
        bytes_ -= size_of(oldest);
        oldest = {};
        ++dropped_;
    }
    if (first_ >= max_waiting) { // keeps a list that is never fetched short
        waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(first_));
        first_ = 0;
    }
    if (!asked_) {
        asked_ = true;
        // Under the lock: once `close` returns, nothing is posted to an executor that may be gone.
        boost::asio::post(executor_, [self = shared_from_this()] { self->drain(); });
    }
}

void cross_thread_updates::close() {
    const std::scoped_lock lock{mutex_};
    closed_ = true;
    waiting_.clear();
}

void cross_thread_updates::drain() {
    std::vector<entry> fetched;
    std::size_t from = 0;
    std::size_t lost = 0;
    {
        const std::scoped_lock lock{mutex_};
        asked_ = false;
        if (closed_) {
            return;
        }
        fetched.swap(waiting_);
        from = std::exchange(first_, 0);
        bytes_ = 0;
        lost = std::exchange(dropped_, 0);
    }
    if (lost != 0) {
        tell_(lost);
    }
    for (; from < fetched.size(); ++from) {
        take_(fetched[from].first, fetched[from].second);
    }
}

} // namespace cles::asio_port
