// SPDX-License-Identifier: BSL-1.0
#include "node/base/deadlines.hpp"

#include "port/environment.hpp"

namespace cles::core {

deadline::~deadline() {
    if (queue_ != nullptr) {
        queue_->disarm(*this);
    }
}

deadline_queue::~deadline_queue() {
    for (auto* d : heap_) {
        d->queue_ = nullptr;
    }
}

void deadline_queue::place(deadline& d, std::size_t at) noexcept {
    heap_[at] = &d;
    d.place_ = at;
}

void deadline_queue::rise(std::size_t at) noexcept {
    auto& d = *heap_[at];
    while (at != 0) {
        const auto parent = (at - 1) / 2;
        if (heap_[parent]->due_ <= d.due_) {
            break;
        }
        place(*heap_[parent], at);
        at = parent;
    }
    place(d, at);
}

void deadline_queue::sink(std::size_t at) noexcept {
    auto& d = *heap_[at];
    for (;;) {
        auto child = at * 2 + 1;
        if (child >= heap_.size()) {
            break;
        }
        if (child + 1 < heap_.size() && heap_[child + 1]->due_ < heap_[child]->due_) {
            ++child;
        }
        if (d.due_ <= heap_[child]->due_) {
            break;
        }
        place(*heap_[child], at);
        at = child;
    }
    place(d, at);
}

void deadline_queue::arm(deadline& d, time_point due) {
    if (d.queue_ != nullptr) {
        d.queue_->disarm(d);
    }
    heap_.push_back(&d);
    d.queue_ = this;
    d.due_ = due;
    rise(heap_.size() - 1);
    if (d.place_ == 0 && on_earliest_) {
        on_earliest_(due);
    }
}

void deadline_queue::disarm(deadline& d) noexcept {
    if (d.queue_ != this) {
        return;
    }
    d.queue_ = nullptr;
    auto* last = heap_.back();
    heap_.pop_back();
    if (last != &d) {
        place(*last, d.place_);
        rise(d.place_);
        sink(last->place_);
    }
}

std::optional<time_point> deadline_queue::next() const noexcept {
    return heap_.empty() ? std::nullopt : std::optional{heap_.front()->due_};
}

void deadline_queue::expire(time_point now) {
    while (!heap_.empty() && heap_.front()->due_ <= now) {
        auto& d = *heap_.front();
        disarm(d);
        d.on_deadline(now);
    }
}

void deadline_schedule::follow(time_point earliest) {
    if (set_for_ <= earliest) {
        return;
    }
    set_for_ = earliest;
    suspend_detector_.expect(earliest, environment_.now());
    environment_.set_timer(earliest);
}

deadline_schedule::expiry::~expiry() {
    of_.set_for_ = time_point::max();
    if (const auto next = deadlines_.next()) {
        of_.follow(*next);
    }
}

} // namespace cles::core
