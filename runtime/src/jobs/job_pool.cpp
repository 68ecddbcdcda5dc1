// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_pool.hpp"

#include "jobs/job_dispatcher.hpp"

#include <utility>

namespace cles::runtime {

job_pool::job_pool(service& host, pool_options options)
    : dispatcher_(std::make_shared<job_dispatcher>(host.get_executor(), std::move(options))) {
    dispatcher_->start();
}

job_pool::~job_pool() { dispatcher_->close(); }

std::size_t job_pool::close(std::chrono::milliseconds limit) { return dispatcher_->close(limit); }

void job_pool::submit(job what) { dispatcher_->submit(std::move(what)); }

node_load job_pool::load() const noexcept { return dispatcher_->load(); }

pool_figures job_pool::figures() const { return dispatcher_->figures(); }

void job_pool::drain(std::chrono::milliseconds limit, std::function<void(const drain_report&)> done) {
    dispatcher_->drain(limit, std::move(done));
}

} // namespace cles::runtime
