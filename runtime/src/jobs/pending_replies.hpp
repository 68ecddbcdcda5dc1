// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "jobs/job_record.hpp"

#include <cstddef>
#include <vector>

namespace cles::runtime {

/// The requests that wait for the replies of jobs: each gets one reply, and progress reports until then. Used on the
/// service's executor.
class pending_replies {
  public:
    pending_replies() = default;
    pending_replies(const pending_replies&) = delete;
    pending_replies& operator=(const pending_replies&) = delete;
    ~pending_replies() = default;

    void add(job_record& r, responder to);
    /// Replies with the result in the job's record. False if no request waits for it.
    bool send(job_record& r);
    void send_progress(job_record& r);
    /// The request has been answered in another way, or has been withdrawn.
    void remove(job_record& r);
    /// The job has been told to stop: its end is not awaited any more, but its request may still be answered.
    void stop_awaiting(job_record& r) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    /// How many jobs have neither answered nor been told to stop.
    [[nodiscard]] std::size_t awaited() const noexcept { return awaited_; }

  private:
    std::size_t size_ = 0;
    std::size_t awaited_ = 0;
    std::vector<job_record::progress_report> reports_; // while they are sent
};

} // namespace cles::runtime
