// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/responder.hpp>

#include "jobs/job_record.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstdint>
#include <string>
#include <string_view>

namespace cles::runtime {

class worker_pool;

/// The requests that jobs send to other nodes. They are sent from the service's executor; their callbacks run on a
/// worker, as continuations of the job. Each callback is called once, by `close` at the latest.
class delegated_requests {
  public:
    explicit delegated_requests(worker_pool& workers) noexcept : workers_(workers) {}
    delegated_requests(const delegated_requests&) = delete;
    delegated_requests& operator=(const delegated_requests&) = delete;
    ~delegated_requests() = default;

    /// \param by the responder of the job; null if its requester waits no more
    void send(const job_ptr& job, const responder* by, const std::string& command, const call_options& options,
              const answer_callback& callback);
    /// Completes all open requests with `unavailable`.
    void close();

  private:
    struct open_request {
        job_ptr job;
        answer_callback callback;
    };
    void complete(std::uint64_t ticket, boost::system::error_code code, std::string_view json,
                  std::string_view message);

    worker_pool& workers_;
    boost::unordered_flat_map<std::uint64_t, open_request> open_;
    std::uint64_t last_ticket_ = 0;
};

} // namespace cles::runtime
