// SPDX-License-Identifier: BSL-1.0
#include "jobs/draining.hpp"

#include "jobs/job_pool.hpp"

#include <utility>

namespace cles::runtime {

void draining::begin(std::chrono::milliseconds limit, std::function<void()> at_limit,
                     std::function<void(const drain_report&)> done) {
    done_ = std::move(done);
    limit_->expires_after(limit);
    limit_->async_wait([at_limit = std::move(at_limit)](boost::system::error_code code) {
        if (!code) {
            at_limit();
        }
    });
}

void draining::end(const drain_report& how) {
    limit_->cancel();
    const auto done = std::exchange(done_, nullptr);
    done(how);
}

void draining::forget() {
    done_ = nullptr;
    limit_.reset();
}

} // namespace cles::runtime
