// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_queue.hpp"

#include <algorithm>
#include <utility>

namespace cles::runtime {

/// The waiting jobs of one requester.
struct turn {
    std::uint64_t requester = 0;
    job_queue::item* first = nullptr;
    job_queue::item* last = nullptr;
    // The ring; both null where there are no jobs.
    turn* before = nullptr;
    turn* after = nullptr;
};

namespace {

// So many requesters are remembered whose last job has gone, for they are likely to come again.
constexpr std::size_t most_idle = 64;

void enter_ring(turn*& next, turn& t) noexcept {
    if (next == nullptr) {
        next = t.before = t.after = &t;
        return;
    }
    t.after = next; // last in turn is who stands before the next
    t.before = next->before;
    t.before->after = &t;
    next->before = &t;
}

void leave_ring(turn*& next, turn& t) noexcept {
    if (t.after == &t) {
        next = nullptr;
    } else {
        t.before->after = t.after;
        t.after->before = t.before;
        next = next == &t ? t.after : next;
    }
    t.before = t.after = nullptr;
}

} // namespace

job_queue::job_queue(std::size_t capacity) : capacity_(capacity) { spare_.reserve(most_idle); }

job_queue::~job_queue() = default;

turn* job_queue::turn_of(std::uint64_t requester) {
    if (const auto found = turns_.find(requester); found != turns_.end()) {
        if (found->second->first == nullptr) {
            --idle_;
            enter_ring(next_, *found->second);
        }
        return found->second.get();
    }
    auto made = std::make_unique<turn>();
    if (!spare_.empty()) {
        made = std::move(spare_.back());
        spare_.pop_back();
    }
    made->requester = requester;
    auto* t = turns_.emplace(requester, std::move(made)).first->second.get();
    enter_ring(next_, *t);
    return t;
}

bool job_queue::push(item& job) {
    if (size_ >= capacity_) {
        return false;
    }
    auto& t = *turn_of(job.requester);
    job.in_ = &t;
    job.before_ = t.last;
    job.after_ = nullptr;
    (t.last != nullptr ? t.last->after_ : t.first) = &job;
    t.last = &job;
    ++size_;
    return true;
}

void job_queue::push_begun(item& job) {
    auto& t = *turn_of(job.requester);
    job.in_ = &t;
    job.before_ = nullptr;
    job.after_ = t.first;
    (t.first != nullptr ? t.first->before_ : t.last) = &job;
    t.first = &job;
    ++size_;
}

void job_queue::take_out(item& job) noexcept {
    auto& t = *job.in_;
    (job.before_ != nullptr ? job.before_->after_ : t.first) = job.after_;
    (job.after_ != nullptr ? job.after_->before_ : t.last) = job.before_;
    job.in_ = nullptr;
    job.before_ = job.after_ = nullptr;
    --size_;
    if (t.first == nullptr) {
        leave_ring(next_, t);
        ++idle_;
    }
}

job_queue::item* job_queue::pop() noexcept {
    if (next_ == nullptr) {
        return nullptr;
    }
    auto& t = *next_;
    next_ = t.after;
    auto* job = t.first;
    take_out(*job);
    sweep();
    return job;
}

void job_queue::remove(item& job) noexcept {
    if (job.in_ != nullptr) {
        take_out(job);
        sweep();
    }
}

// Forgets those who have no jobs, once they are many; so that each costs a constant share of it.
void job_queue::sweep() {
    if (idle_ <= std::max(most_idle, turns_.size() / 2)) {
        return;
    }
    for (auto at = turns_.begin(); at != turns_.end();) {
        if (at->second->first == nullptr) {
            if (spare_.size() < most_idle) {
                spare_.push_back(std::move(at->second));
            }
            turns_.erase(at++);
        } else {
            ++at;
        }
    }
    idle_ = 0;
}

} // namespace cles::runtime
