// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "jobs/job_record.hpp"

#include <cstddef>
#include <vector>

namespace cles::runtime {

/// Those who wait for the answers of jobs: each is answered once, and told of progress until then. On the service's
/// executor.
class open_answers {
  public:
    open_answers() = default;
    open_answers(const open_answers&) = delete;
    open_answers& operator=(const open_answers&) = delete;
    ~open_answers() = default;

    void add(job_record& r, responder to);
    /// Answers with what the job has left in its record. False where nobody waits.
    bool give(job_record& r);
    void tell_progress(job_record& r);
    /// Nobody waits any more: answered in another way, or gone.
    void conclude(job_record& r);
    /// The job has been told to stop, and is not waited for, though its requester may still be answered.
    void give_up(job_record& r) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    /// How many have neither been answered nor given up.
    [[nodiscard]] std::size_t awaited() const noexcept { return awaited_; }

  private:
    std::size_t size_ = 0;
    std::size_t awaited_ = 0;
    std::vector<job_record::report> reports_; // while they are told
};

} // namespace cles::runtime
