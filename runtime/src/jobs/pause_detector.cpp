// SPDX-License-Identifier: BSL-1.0
#include "jobs/pause_detector.hpp"

#include "jobs/job_pool.hpp"
#include "jobs/worker_pool.hpp"

#include <boost/asio/post.hpp>

#include <utility>

namespace cles::runtime {
namespace {

// The input that arrived during a pause counts as read when so many rounds of the executor have brought no job and no
// withdrawal, or after this time.
constexpr unsigned max_quiet_rounds = 16;
constexpr std::chrono::milliseconds max_recovery{250};

} // namespace

pause_detector::pause_detector(const boost::asio::any_io_executor& executor, worker_pool& workers,
                               const pool_options& options, std::function<void(std::chrono::nanoseconds)> on_pause)
    : executor_(executor), workers_(workers), options_(options), on_pause_(std::move(on_pause)) {}

void pause_detector::expect_timer(std::chrono::milliseconds interval) {
    interval_ = interval;
    update_executor_due();
}

void pause_detector::update_executor_due() {
    if (options_.check_interval.count() > 0) {
        workers_.set_executor_due(time_point::clock::now() + interval_ + options_.executor_lateness);
    }
}

void pause_detector::detect() {
    const auto now = time_point::clock::now();
    if (closed_ || !workers_.executor_is_late(now)) {
        return;
    }
    update_executor_due();
    if (std::exchange(recovering_, true)) {
        return;
    }
    workers_.pause();
    recovery_began_ = now;
    quiet_rounds_ = 0;
    inputs_last_round_ = inputs_;
    on_pause_(interval_ + options_.executor_lateness);
    post_round();
}

void pause_detector::check() {
    detect();
    if (!recovering_ && !closed_) {
        workers_.wake();
    }
}

// Posted functions run after those that are ready, and after a check for new input.
void pause_detector::post_round() {
    boost::asio::post(executor_, [weak = self_] {
        if (const auto self = weak.lock(); self && !self->closed_) {
            self->run_round();
        }
    });
}

void pause_detector::run_round() {
    quiet_rounds_ = inputs_ == inputs_last_round_ ? quiet_rounds_ + 1 : 0;
    inputs_last_round_ = inputs_;
    if (quiet_rounds_ < max_quiet_rounds && time_point::clock::now() - recovery_began_ < max_recovery) {
        post_round();
        return;
    }
    recovering_ = false;
    update_executor_due();
    workers_.unpause();
}

} // namespace cles::runtime
