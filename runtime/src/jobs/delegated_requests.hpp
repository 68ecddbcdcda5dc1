// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/responder.hpp>

#include "jobs/job_context.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstdint>
#include <string>
#include <string_view>

namespace cles::runtime {

class worker_pool;

/// What jobs ask others: sent from the service's executor, and answered on a worker, as a part of the job that asks.
/// Each is answered once, by `close` at the latest.
class onward_requests {
  public:
    explicit onward_requests(worker_pool& workers) noexcept : workers_(workers) {}
    onward_requests(const onward_requests&) = delete;
    onward_requests& operator=(const onward_requests&) = delete;
    ~onward_requests() = default;

    /// \param by the responder of the job that asks; null where nobody waits for it any more
    void send(const job_context& asks, const responder* by, const std::string& command, const call_options& options,
              const answer_callback& answered);
    /// Answers all that are open with `unavailable`.
    void close();

  private:
    struct question {
        job_context asks;
        answer_callback answered;
    };
    void answer(std::uint64_t ticket, boost::system::error_code code, std::string_view json, std::string_view message);

    worker_pool& workers_;
    boost::unordered_flat_map<std::uint64_t, question> open_;
    std::uint64_t last_ticket_ = 0;
};

} // namespace cles::runtime
