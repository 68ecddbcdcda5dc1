// SPDX-License-Identifier: BSL-1.0
#include "jobs/pending_replies.hpp"

#include <mutex>
#include <utility>

namespace cles::runtime {

void pending_replies::add(job_record& r, responder to) {
    r.requester_.emplace(std::move(to));
    r.awaited_ = true;
    ++size_;
    ++awaited_;
}

bool pending_replies::send(job_record& r) {
    if (!r.requester_) {
        return false;
    }
    if (r.retry_) {
        r.requester_->refuse(r.result_, *r.retry_);
    } else if (r.failure_) {
        r.requester_->fail(*r.failure_, r.result_);
    } else if (r.result_.empty()) {
        r.requester_->done();
    } else {
        r.requester_->done(compact_json{r.result_});
    }
    remove(r);
    return true;
}

void pending_replies::send_progress(job_record& r) {
    {
        const std::lock_guard lock{r.mutex_};
        reports_.swap(r.reports_);
    }
    for (const auto& each : reports_) {
        if (!r.requester_ || !r.requester_->progress(each.fraction, compact_json{each.json})) {
            r.progress_unwanted_.store(true, std::memory_order_relaxed);
            break;
        }
    }
    reports_.clear();
}

void pending_replies::remove(job_record& r) {
    if (r.requester_) {
        r.requester_.reset();
        --size_;
        stop_awaiting(r);
    }
}

void pending_replies::stop_awaiting(job_record& r) noexcept { awaited_ -= std::exchange(r.awaited_, false) ? 1 : 0; }

} // namespace cles::runtime
