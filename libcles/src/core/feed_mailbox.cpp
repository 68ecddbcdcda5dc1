// SPDX-License-Identifier: BSL-1.0
#include "core/feed_mailbox.hpp"

#include <cles/error.hpp>

#include <utility>

namespace cles::core {

bool feed_mailbox::put(const detail::raw_event& event) {
    if (closed_) {
        return true;
    }
    if (waiter_ != nullptr && queue_.empty()) {
        auto* operation = waiter_.release();
        if (!operation->deliver(event)) {
            waiter_.reset(operation);
            return false;
        }
        return true;
    }
    if (!event.has_json()) {
        return false;
    }
    queue_.push(event);
    return true;
}

bool feed_mailbox::next(event_ptr operation) {
    waiter_ = std::move(operation);
    return !queue_.empty();
}

void feed_mailbox::pump() {
    if (waiter_ != nullptr && !queue_.empty()) {
        auto* operation = waiter_.release();
        queue_.pop([operation](const detail::raw_event& event) { operation->deliver(event); }); // checked when queued
    }
}

void feed_mailbox::cancel() {
    if (auto* operation = waiter_.release()) {
        operation->fail(errc::cancelled, "the wait was cancelled");
    }
}

feed_mailbox::event_ptr feed_mailbox::close() {
    closed_ = true;
    return std::move(waiter_);
}

} // namespace cles::core
