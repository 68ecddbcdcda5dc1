// SPDX-License-Identifier: BSL-1.0
#include "node/publish/feed_mailbox.hpp"

#include <cles/error.hpp>

#include <algorithm>
#include <exception>
#include <iterator>

namespace cles::core {

feed_mailbox::~feed_mailbox() {
    if (reading_ != nullptr) {
        reading_->feed_is_gone = true;
    }
}

bool feed_mailbox::put(const detail::raw_event& event, hand_over when) {
    if (closed_) {
        return true;
    }
    if (batch_ != nullptr || reading_ != nullptr) {
        return put_in_batch(event, when);
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
    } else if (waiter_ != nullptr) {
        queue_.push_for_reader(event);
    } else {
        queue_.push(event);
    }
    return true;
}

bool feed_mailbox::next(event_ptr operation) {
    waiter_ = std::move(operation);
    batch_ = waiter_->as_batch();
    return !queue_.empty();
}

bool feed_mailbox::pump() {
    is_announced_ = false;
    if (batch_ != nullptr) {
        return pump_batch();
    }
    if (waiter_ == nullptr || queue_.empty()) {
        return false;
    }
    auto* operation = waiter_.release();
    queue_.pop([operation](const detail::raw_event& event) { operation->deliver(event); }); // checked when queued
    return true;
}

void feed_mailbox::cancel() {
    if (waiter_ != nullptr && kept_ == 0) {
        batch_ = nullptr;
        completions_.fail(std::move(waiter_), errc::cancelled, "the wait was cancelled");
    }
}

feed_mailbox::event_ptr feed_mailbox::close() {
    closed_ = true;
    batch_ = nullptr;
    return std::move(waiter_);
}

// -- batches ---------------------------------------------------------------------------------------------------------

bool feed_mailbox::put_in_batch(const detail::raw_event& event, hand_over when) {
    using verdict = detail::pending_batch::verdict;
    if (batch_ != nullptr && event.kind == feed_event::update && when == hand_over::now && queue_.empty()) {
        auto& completions = completions_;
        auto found = verdict::kept; // an exception comes from its conversion
        reading call;
        completions.now([&] { found = keep(event, call); });
        if (!call.feed_is_gone && batch_ != nullptr && !queue_.empty()) {
            announce(); // what the conversion has let in: a call of `pump` meanwhile could not deliver it
        }
        if (call.feed_is_gone || found == verdict::kept) {
            if (!call.feed_is_gone && batch_ != nullptr && kept_ != 0) {
                if (queue_.has_space(kept_, kept_bytes_)) {
                    announce();
                } else { // more would take too much memory
                    auto* const batch = take_batch();
                    completions.now([batch] { batch->complete(); });
                }
            }
            return true;
        }
        if (found == verdict::malformed) {
            return false;
        }
    }
    if (!event.has_json()) {
        return false;
    }
    queue_.push_for_reader(event);
    announce();
    return true;
}

bool feed_mailbox::pump_batch() {
    while (batch_ != nullptr && !queue_.empty()) {
        auto oldest = queue_.take();
        reading call;
        try {
            if (keep(oldest.view(), call) == detail::pending_batch::verdict::full) {
                queue_.put_back(std::move(oldest));
                break;
            }
        } catch (...) { // of its conversion; what else waits is not affected
            announce();
            throw;
        }
    }
    if (batch_ == nullptr || kept_ == 0) {
        return false;
    }
    take_batch()->complete();
    return true;
}

// Meanwhile, the operation belongs to this call.
detail::pending_batch::verdict feed_mailbox::keep(const detail::raw_event& event, reading& call) {
    auto operation = std::move(waiter_);
    auto* const batch = std::exchange(batch_, nullptr);
    auto& completions = completions_;
    auto found = detail::pending_batch::verdict::malformed;
    std::exception_ptr thrown;
    reading_ = &call;
    try {
        found = batch->keep(event);
    } catch (...) {
        thrown = std::current_exception();
    }
    const bool closed = call.feed_is_gone || closed_;
    if (!call.feed_is_gone) {
        reading_ = nullptr;
    }
    if (closed) {
        completions.fail(std::move(operation), errc::cancelled, "the feed was closed");
    } else {
        waiter_ = std::move(operation);
        batch_ = batch;
        if (thrown == nullptr && found == detail::pending_batch::verdict::kept) {
            ++kept_;
            kept_bytes_ += event.body.size();
        }
    }
    if (thrown != nullptr) {
        std::rethrow_exception(thrown);
    }
    return found;
}

detail::pending_batch* feed_mailbox::take_batch() noexcept {
    static_cast<void>(waiter_.release());
    kept_ = 0;
    kept_bytes_ = 0;
    return std::exchange(batch_, nullptr);
}

void feed_mailbox::announce() {
    if (!std::exchange(is_announced_, true)) {
        pump_soon_();
    }
}

// -- the queue -------------------------------------------------------------------------------------------------------

kept_event feed_queue::take() {
    if (returned_) {
        auto e = *std::move(returned_);
        returned_.reset();
        return e;
    }
    if (shed_ != 0) {
        return kept_event{detail::raw_event{.kind = feed_event::gap, .missed = std::exchange(shed_, 0)}};
    }
    auto e = std::move(entries_.front());
    entries_.pop_front();
    forget(e);
    return e;
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

void feed_queue::push(const detail::raw_event& event, std::size_t max_values) {
    constexpr std::ptrdiff_t max_status_events = 16;
    entries_.emplace_back(event);
    if (is_value(entries_.back())) {
        ++values_;
        bytes_ += event.body.size();
    } else if (is_status_event(entries_.back()) &&
               std::ranges::count_if(entries_, is_status_event) > max_status_events) {
        remove(std::ranges::find_if(entries_, is_status_event));
    }
    while (values_ > max_values || (bytes_ > max_bytes_ && values_ > 1)) {
        drop_oldest_value();
    }
}

} // namespace cles::core
