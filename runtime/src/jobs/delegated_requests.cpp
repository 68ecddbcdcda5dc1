// SPDX-License-Identifier: BSL-1.0
#include "jobs/delegated_requests.hpp"

#include "jobs/worker_pool.hpp"

#include <string_view>
#include <utility>

namespace cles::runtime {

void delegated_requests::send(const job_ptr& job, const responder* by, const std::string& command,
                              const call_options& options, const answer_callback& callback) {
    const auto ticket = ++last_ticket_;
    open_.emplace(ticket, open_request{job, callback});
    if (by == nullptr) {
        complete(ticket, errc::cancelled, "{}", "the requester of the job no longer waits");
        return;
    }
    auto forwarded = options;
    if (options.on_progress_) {
        forwarded.on_progress([this, job, on_progress = options.on_progress_](double fraction, std::string_view json) {
            workers_.schedule(*job, [on_progress, fraction, json = std::string{json}] { on_progress(fraction, json); });
        });
    }
    // The job keeps this alive, even if the answer comes after `close`.
    by->delegate(command, forwarded,
                 [this, job, ticket](boost::system::error_code code, std::string_view json, std::string_view message) {
                     complete(ticket, code, json, message);
                 });
}

void delegated_requests::complete(std::uint64_t ticket, boost::system::error_code code, std::string_view json,
                                  std::string_view message) {
    const auto found = open_.find(ticket);
    if (found == open_.end()) {
        return;
    }
    const auto done = std::move(found->second);
    open_.erase(found);
    workers_.schedule(*done.job, [callback = done.callback, code, json = std::string{json},
                                  message = std::string{message}] { callback(code, json, message); });
}

void delegated_requests::close() {
    while (!open_.empty()) {
        complete(open_.begin()->first, errc::unavailable, "{}", "the node is stopping");
    }
}

} // namespace cles::runtime
