// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_records.hpp"

#include <utility>

namespace cles::runtime {
namespace {

constexpr std::size_t most_spare = 1024;

} // namespace

job_record& job_records::take(std::shared_ptr<pool_state> pool) {
    if (spare_.empty()) {
        spare_.push_back(std::make_unique<job_record>());
    }
    auto& r = *spare_.back().release();
    spare_.pop_back();
    r.open(std::move(pool));
    r.index = in_use_.size();
    in_use_.push_back(&r);
    return r;
}

void job_records::recycle(job_record& r) {
    std::unique_ptr<job_record> owned{&r};
    in_use_.back()->index = r.index;
    in_use_[r.index] = in_use_.back();
    in_use_.pop_back();
    r.clear(); // the pool lives: it runs
    if (spare_.size() < most_spare) {
        spare_.push_back(std::move(owned));
    }
}

} // namespace cles::runtime
