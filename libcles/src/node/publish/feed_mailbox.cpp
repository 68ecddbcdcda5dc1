// SPDX-License-Identifier: BSL-1.0
#include "node/publish/feed_mailbox.hpp"

#include <cles/error.hpp>

#include <algorithm>
#include <iterator>

namespace cles::core {

bool feed_mailbox::put(const detail::raw_event& event, hand_over when) {
    if (closed_) {
        return true;
    }
    const bool waited_for = waiter_ != nullptr && queue_.empty();
    if (waited_for && event.kind == feed_event::update && when == hand_over::now) {
        auto* operation = waiter_.release();
        bool taken = true; // an exception comes from its handler
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

bool feed_mailbox::pump() {
    if (waiter_ == nullptr || queue_.empty()) {
        return false;
    }
    auto* operation = waiter_.release();
    queue_.pop([operation](const detail::raw_event& event) { operation->deliver(event); }); // checked when queued
    return true;
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

void feed_queue::forget(const kept_event& e) noexcept {
    if (is_value(e)) {
        --values_;
        bytes_ -= e.body.size();
    }
}

// Moves those before it, usually none or a few. `std::deque` may also move the others, which takes 4 kB of code.
std::deque<kept_event>::iterator feed_queue::remove(std::deque<kept_event>::iterator which) {
    const auto before = which - entries_.begin();
    for (; which != entries_.begin(); --which) {
        *which = std::move(*std::prev(which));
    }
    entries_.pop_front();
    return entries_.begin() + before;
}

// A gap before the value goes with it: one gap reports both. A `current` value is not an update, so nothing is missed
// with it: what the publisher has sent since follows it.
void feed_queue::drop_oldest_value() {
    for (auto e = entries_.begin(); e != entries_.end();) {
        if (is_status_event(*e)) {
            ++e;
            continue;
        }
        const bool found = is_value(*e);
        shed_ += e->kind == feed_event::update ? 1 : e->missed;
        forget(*e);
        e = remove(e);
        if (found) {
            return;
        }
    }
}

void feed_queue::push(const detail::raw_event& event) {
    constexpr std::ptrdiff_t max_status_events = 16;
    entries_.emplace_back(event);
    if (is_value(entries_.back())) {
        ++values_;
        bytes_ += event.body.size();
    } else if (is_status_event(entries_.back()) &&
               std::ranges::count_if(entries_, is_status_event) > max_status_events) {
        remove(std::ranges::find_if(entries_, is_status_event));
    }
    while (values_ > max_values_ || (bytes_ > max_bytes_ && values_ > 1)) {
        drop_oldest_value();
    }
}

} // namespace cles::core
