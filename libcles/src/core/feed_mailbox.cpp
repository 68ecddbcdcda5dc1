// SPDX-License-Identifier: BSL-1.0
#include "core/feed_mailbox.hpp"

#include <cles/error.hpp>

#include <utility>

namespace cles::core {

bool feed_mailbox::put(const detail::raw_event& event, hand_over when) {
    if (closed_) {
        return true;
    }
    const bool waited_for = waiter_ != nullptr && queue_.empty();
    if (waited_for && event.kind == feed_event::update && when == hand_over::now) {
        auto* operation = waiter_.release();
        bool taken = true; // what is thrown comes from its handler
        completions_.now([&] { taken = operation->deliver(event); });
        if (!taken) {
            waiter_.reset(operation);
        }
        return taken;
    }
    if (!event.has_json()) {
        return false;
    }
    if (waited_for) {
        completions_.deliver(std::move(waiter_), event);
    } else {
        queue_.push(event);
    }
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
    if (waiter_ != nullptr) {
        completions_.fail(std::move(waiter_), errc::cancelled, "the wait was cancelled");
    }
}

feed_mailbox::event_ptr feed_mailbox::close() {
    closed_ = true;
    return std::move(waiter_);
}

} // namespace cles::core
