// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "jobs/job_record.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace cles::runtime {

/// The records of a pool's jobs: those in use, and some that wait to be used again. On the service's executor.
class job_records {
  public:
    job_records() = default;
    job_records(const job_records&) = delete;
    job_records& operator=(const job_records&) = delete;
    ~job_records() = default;

    /// One for a new job, with one reference.
    job_record& take(std::shared_ptr<pool_state> pool);
    /// Nobody holds it any more.
    void recycle(job_record& r);
    /// From now on each ends itself.
    void disown() noexcept { in_use_.clear(); }
    void drop_spare() noexcept { spare_.clear(); }

    /// Those in use, in no order; what is recycled leaves its place to another.
    [[nodiscard]] std::size_t size() const noexcept { return in_use_.size(); }
    [[nodiscard]] job_record& operator[](std::size_t index) const noexcept { return *in_use_[index]; }

  private:
    std::vector<std::unique_ptr<job_record>> spare_;
    std::vector<job_record*> in_use_; // owned; each knows its place here
};

} // namespace cles::runtime
