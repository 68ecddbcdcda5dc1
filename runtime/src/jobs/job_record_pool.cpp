// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_record_pool.hpp"

#include <utility>

namespace cles::runtime {
namespace {

constexpr std::size_t max_spare = 1024; // records

} // namespace

job_record& job_record_pool::acquire(std::shared_ptr<job_dispatcher> dispatcher) {
    if (spare_.empty()) {
        spare_.push_back(std::make_unique<job_record>());
    }
    auto& r = *spare_.back().release();
    spare_.pop_back();
    r.open(std::move(dispatcher));
    r.index = in_use_.size();
    in_use_.push_back(&r);
    return r;
}

void job_record_pool::recycle(job_record& r) {
    std::unique_ptr<job_record> owned{&r};
    in_use_.back()->index = r.index;
    in_use_[r.index] = in_use_.back();
    in_use_.pop_back();
    r.clear(); // the dispatcher, which runs, outlives this
    if (spare_.size() < max_spare) {
        spare_.push_back(std::move(owned));
    }
}

} // namespace cles::runtime
