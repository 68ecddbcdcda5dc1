// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_queue.hpp"

#include <algorithm>
#include <utility>

namespace cles::runtime {

/// The waiting jobs of one requester.
struct requester_queue {
    std::uint64_t requester = 0;
    job_queue::item* first = nullptr;
    job_queue::item* last = nullptr;
    // The ring of requesters; both null without jobs.
    requester_queue* before = nullptr;
    requester_queue* after = nullptr;
};

namespace {

// How many requesters without jobs are kept, because they are likely to send more.
constexpr std::size_t max_idle = 64;

void enter_ring(requester_queue*& next, requester_queue& q) noexcept {
    if (next == nullptr) {
        next = q.before = q.after = &q;
        return;
    }
    q.after = next; // the one before the next is the last to be served
    q.before = next->before;
    q.before->after = &q;
    next->before = &q;
}

void leave_ring(requester_queue*& next, requester_queue& q) noexcept {
    if (q.after == &q) {
        next = nullptr;
    } else {
        q.before->after = q.after;
        q.after->before = q.before;
        next = next == &q ? q.after : next;
    }
    q.before = q.after = nullptr;
}

} // namespace

job_queue::job_queue(std::size_t capacity) : capacity_(capacity) { spare_.reserve(max_idle); }

job_queue::~job_queue() = default;

requester_queue* job_queue::queue_of(std::uint64_t requester) {
    if (const auto found = requesters_.find(requester); found != requesters_.end()) {
        if (found->second->first == nullptr) {
            --idle_;
            enter_ring(next_, *found->second);
        }
        return found->second.get();
    }
    auto made = std::make_unique<requester_queue>();
    if (!spare_.empty()) {
        made = std::move(spare_.back());
        spare_.pop_back();
    }
    made->requester = requester;
    auto* q = requesters_.emplace(requester, std::move(made)).first->second.get();
    enter_ring(next_, *q);
    return q;
}

bool job_queue::push(item& job) {
    if (size_ >= capacity_) {
        return false;
    }
    auto& q = *queue_of(job.requester);
    job.queue_ = &q;
    job.previous_ = q.last;
    job.next_in_queue_ = nullptr;
    (q.last != nullptr ? q.last->next_in_queue_ : q.first) = &job;
    q.last = &job;
    ++size_;
    return true;
}

void job_queue::push_resumed(item& job) {
    auto& q = *queue_of(job.requester);
    job.queue_ = &q;
    job.previous_ = nullptr;
    job.next_in_queue_ = q.first;
    (q.first != nullptr ? q.first->previous_ : q.last) = &job;
    q.first = &job;
    ++size_;
}

void job_queue::unlink(item& job) noexcept {
    auto& q = *job.queue_;
    (job.previous_ != nullptr ? job.previous_->next_in_queue_ : q.first) = job.next_in_queue_;
    (job.next_in_queue_ != nullptr ? job.next_in_queue_->previous_ : q.last) = job.previous_;
    job.queue_ = nullptr;
    job.previous_ = job.next_in_queue_ = nullptr;
    --size_;
    if (q.first == nullptr) {
        leave_ring(next_, q);
        ++idle_;
    }
}

job_queue::item* job_queue::pop() noexcept {
    if (next_ == nullptr) {
        return nullptr;
    }
    auto& q = *next_;
    next_ = q.after;
    auto* job = q.first;
    unlink(*job);
    forget_idle();
    return job;
}

void job_queue::remove(item& job) noexcept {
    if (job.queue_ != nullptr) {
        unlink(job);
        forget_idle();
    }
}

// Removes the requesters without jobs once there are many, so that the cost per job is constant.
void job_queue::forget_idle() {
    if (idle_ <= std::max(max_idle, requesters_.size() / 2)) {
        return;
    }
    for (auto at = requesters_.begin(); at != requesters_.end();) {
        if (at->second->first == nullptr) {
            if (spare_.size() < max_idle) {
                spare_.push_back(std::move(at->second));
            }
            requesters_.erase(at++);
        } else {
            ++at;
        }
    }
    idle_ = 0;
}

} // namespace cles::runtime
