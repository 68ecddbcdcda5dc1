// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_queue.hpp"

#include <algorithm>

namespace cles::runtime {
namespace {

// How many requesters without jobs are kept, because they are likely to send more.
constexpr std::size_t max_idle = 64;

} // namespace

// The requester is served after all others, unless it has jobs already.
job_queue::requesters::iterator job_queue::queue_for(item& job) {
    auto found = known_.find(job.requester);
    if (found == known_.end()) {
        if (idle_.size() < max_idle) {
            idle_.emplace_front();
        } else { // the memory of the one that has been idle for longest
            known_.erase(idle_.front().requester);
        }
        found = known_.emplace(job.requester, idle_.begin()).first;
        idle_.front().requester = job.requester;
    }
    const auto own = found->second;
    if (own->jobs.empty()) {
        own->turn = ++last_turn_;
        with_jobs_.splice(with_jobs_.end(), idle_, own);
    }
    job.queued_ = true;
    ++size_;
    movable_ += job.movable ? 1 : 0;
    movable_queued_ += job.movable ? 1 : 0;
    return own;
}

bool job_queue::push(item& job) {
    if (size_ >= capacity_) {
        return false;
    }
    job.order_ = ++last_order_;
    queue_for(job)->jobs.push_back(job);
    return true;
}

void job_queue::put_back(item& job) {
    const auto own = queue_for(job);
    auto& jobs = own->jobs;
    jobs.insert(std::find_if(jobs.begin(), jobs.end(), [&](const item& each) { return each.order_ > job.order_; }),
                job);
    if (job.turn_ < own->turn) {
        own->turn = job.turn_;
        const auto next = std::find_if(with_jobs_.begin(), with_jobs_.end(),
                                       [&](const requester_queue& each) { return each.turn > own->turn; });
        with_jobs_.splice(next, with_jobs_, own);
    }
}

void job_queue::push_resumed(item& job) {
    job.movable = false;
    queue_for(job)->jobs.push_front(job);
}

void job_queue::unlink(requesters::iterator from, item& job) noexcept {
    from->jobs.erase(from->jobs.iterator_to(job));
    job.queued_ = false;
    --size_;
    movable_ -= job.movable ? 1 : 0;
    if (!from->jobs.empty()) {
        return;
    }
    idle_.splice(idle_.end(), with_jobs_, from);
    while (idle_.size() > std::max(max_idle, known_.size() / 2)) {
        known_.erase(idle_.front().requester);
        idle_.pop_front();
    }
}

job_queue::item* job_queue::pop() noexcept {
    if (empty()) {
        return nullptr;
    }
    const auto next = with_jobs_.begin();
    auto& job = next->jobs.front();
    with_jobs_.splice(with_jobs_.end(), with_jobs_, next);
    next->turn = ++last_turn_;
    unlink(next, job);
    return &job;
}

void job_queue::remove(item& job) noexcept {
    if (job.queued()) {
        const auto own = known_.find(job.requester)->second;
        job.turn_ = own->turn;
        unlink(own, job);
    }
}

} // namespace cles::runtime
