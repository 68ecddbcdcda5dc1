// SPDX-License-Identifier: BSL-1.0
#include "jobs/drain_operation.hpp"

#include <boost/system/error_code.hpp>

#include <utility>

namespace cles::runtime {

void drain_operation::begin(std::chrono::milliseconds limit, std::function<void()> on_limit,
                            std::function<void(const drain_report&)> done) {
    done_ = std::move(done);
    limit_->expires_after(limit);
    limit_->async_wait([on_limit = std::move(on_limit)](boost::system::error_code code) {
        if (!code) {
            on_limit();
        }
    });
}

void drain_operation::complete(const drain_report& report) {
    limit_->cancel();
    const auto done = std::exchange(done_, nullptr);
    done(report);
}

void drain_operation::cancel() {
    done_ = nullptr;
    limit_.reset();
}

} // namespace cles::runtime
