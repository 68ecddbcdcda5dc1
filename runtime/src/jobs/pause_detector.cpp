// SPDX-License-Identifier: BSL-1.0
#include "jobs/pause_detector.hpp"

#include "jobs/job_pool.hpp"
#include "jobs/worker_pool.hpp"

#include <boost/asio/post.hpp>

#include <utility>

namespace cles::runtime {

pause_detector::pause_detector(const boost::asio::any_io_executor& executor, worker_pool& workers,
                               const pool_options& options, std::function<void(std::chrono::nanoseconds)> on_pause)
    : executor_(executor), workers_(workers), options_(options), on_pause_(std::move(on_pause)),
      gate_(options.max_wait) {
    workers_.set_executor_due(gate_.open_until());
}

void pause_detector::expect_timer(std::chrono::milliseconds interval) {
    interval_ = interval;
    timer_due_ = time_point::clock::now() + interval_ + options_.executor_lateness;
}

void pause_detector::report() {
    if (!closed_ && options_.check_interval.count() > 0 && time_point::clock::now() > timer_due_) {
        expect_timer(interval_);
        on_pause_(interval_ + options_.executor_lateness);
    }
}

void pause_detector::detect() {
    report();
    if (closed_) {
        return;
    }
    if (gate_.begin_round(time_point::clock::now())) {
        workers_.pause();
        post_round();
    }
    workers_.set_executor_due(gate_.open_until());
}

void pause_detector::check() {
    detect();
    if (!gate_.is_closed() && !closed_) {
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
    if (gate_.end_round(time_point::clock::now())) {
        workers_.set_executor_due(gate_.open_until());
        workers_.unpause();
        on_read_();
    } else {
        post_round();
    }
}

} // namespace cles::runtime
