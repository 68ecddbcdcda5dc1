// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "jobs/job_record.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace cles::runtime {

/// The records of a pool's jobs: those in use, and some spare ones. Used on the service's executor.
class job_record_pool {
  public:
    job_record_pool() = default;
    job_record_pool(const job_record_pool&) = delete;
    job_record_pool& operator=(const job_record_pool&) = delete;
    ~job_record_pool() = default;

    /// A record for a new job, with one reference.
    job_record& acquire(std::shared_ptr<job_dispatcher> dispatcher);
    /// Takes back a record without references.
    void recycle(job_record& r);
    /// From now on the records destroy themselves.
    void detach_all() noexcept { in_use_.clear(); }
    void free_spare() noexcept { spare_.clear(); }

    /// The records in use, in no particular order: recycling one moves another.
    [[nodiscard]] std::size_t size() const noexcept { return in_use_.size(); }
    [[nodiscard]] job_record& operator[](std::size_t index) const noexcept { return *in_use_[index]; }

  private:
    std::vector<std::unique_ptr<job_record>> spare_;
    std::vector<job_record*> in_use_; // owned; each knows its index
};

} // namespace cles::runtime
