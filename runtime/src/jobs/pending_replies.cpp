// SPDX-License-Identifier: BSL-1.0
#include "jobs/pending_replies.hpp"

#include <mutex>
#include <string_view>
#include <utility>

namespace cles::runtime {
namespace {

/// JSON that is known to be valid.
struct as_it_is {
    std::string_view json;
};

} // namespace
} // namespace cles::runtime

template <>
struct cles::converter<cles::runtime::as_it_is> {
    static void write(json_writer& w, const runtime::as_it_is& value) { w.raw(value.json); }
};

namespace cles::runtime {

void open_answers::add(job_record& r, responder to) {
    r.answer_.emplace(std::move(to));
    r.awaited_ = true;
    ++size_;
    ++awaited_;
}

bool open_answers::give(job_record& r) {
    if (!r.answer_) {
        return false;
    }
    if (r.retry_) {
        r.answer_->refuse(r.result_, *r.retry_);
    } else if (r.failure_) {
        r.answer_->fail(*r.failure_, r.result_);
    } else if (r.result_.empty()) {
        r.answer_->done();
    } else {
        r.answer_->done(as_it_is{r.result_});
    }
    conclude(r);
    return true;
}

void open_answers::tell_progress(job_record& r) {
    {
        const std::lock_guard lock{r.mutex_};
        reports_.swap(r.reports_);
    }
    for (const auto& each : reports_) {
        if (!r.answer_ || !r.answer_->progress(each.fraction, as_it_is{each.json})) {
            r.unheard_.store(true, std::memory_order_relaxed);
            break;
        }
    }
    reports_.clear();
}

void open_answers::conclude(job_record& r) {
    if (r.answer_) {
        r.answer_.reset();
        --size_;
        give_up(r);
    }
}

void open_answers::give_up(job_record& r) noexcept { awaited_ -= std::exchange(r.awaited_, false) ? 1 : 0; }

} // namespace cles::runtime
