// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_pool.hpp"

#include "jobs/job_dispatcher.hpp"

#include <utility>

namespace cles::runtime {

job_pool::job_pool(service& host, pool_options options)
    : state_(std::make_shared<pool_state>(host.get_executor(), std::move(options))) {
    state_->start();
}

job_pool::~job_pool() { state_->close(); }

std::size_t job_pool::close(std::chrono::milliseconds limit) { return state_->close(limit); }

void job_pool::submit(job what) { state_->submit(std::move(what)); }

node_load job_pool::load() const noexcept { return state_->load(); }

pool_figures job_pool::figures() const { return state_->figures(); }

void job_pool::drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done) {
    state_->drain(limit, std::move(done));
}

} // namespace cles::runtime
