// SPDX-License-Identifier: BSL-1.0
#include "inbox.hpp"

#include <utility>

namespace cles::perf::peers {

void inbox::take(std::size_t subscriber, const publication& value) {
    const std::lock_guard lock{guard_};
    if (!reached_[subscriber]) {
        reached_[subscriber] = true;
        ++reached_count_;
    }
    if (counting_ && value.published_ns >= began_ && arrivals_.count() < expected_) {
        try {
            arrivals_.take(value);
        } catch (...) {
            failure_ = std::current_exception();
        }
    }
    if (settled()) {
        news_.notify_one();
    }
}

void inbox::fail(std::exception_ptr why) {
    const std::lock_guard lock{guard_};
    failure_ = std::move(why);
    news_.notify_one();
}

bool inbox::all_reached() {
    const std::lock_guard lock{guard_};
    throw_failure();
    return reached_count_ == reached_.size();
}

void inbox::begin(const fan_out_order& order, latency_recorder* record) {
    const std::lock_guard lock{guard_};
    arrivals_ = arrivals{record};
    expected_ = order.binders * order.updates;
    began_ = monotonic_ns();
    counting_ = true;
}

inbox::state inbox::look() {
    const std::lock_guard lock{guard_};
    throw_failure();
    return {.count = arrivals_.count(), .complete = arrivals_.count() == expected_};
}

void inbox::wait_for(std::chrono::milliseconds at_most) {
    std::unique_lock lock{guard_};
    news_.wait_for(lock, at_most, [this] { return settled(); });
    throw_failure();
}

fan_out_tally inbox::tally() {
    const std::lock_guard lock{guard_};
    return arrivals_.tally();
}

bool inbox::settled() const {
    return failure_ || (counting_ ? arrivals_.count() == expected_ : reached_count_ == reached_.size());
}

void inbox::throw_failure() const {
    if (failure_) {
        std::rethrow_exception(failure_);
    }
}

} // namespace cles::perf::peers
