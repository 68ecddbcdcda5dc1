// SPDX-License-Identifier: BSL-1.0
#include "jobs/delegated_requests.hpp"

#include "jobs/worker_pool.hpp"

#include <string_view>
#include <utility>

namespace cles::runtime {

void onward_requests::send(const job_context& asks, const responder* by, const std::string& command,
                           const call_options& options, const answer_callback& answered) {
    const auto ticket = ++last_ticket_;
    open_.emplace(ticket, question{asks, answered});
    if (by == nullptr) {
        answer(ticket, errc::cancelled, "{}", "nobody waits for the job that asks");
        return;
    }
    auto chosen = options;
    if (options.on_progress_) {
        chosen.on_progress([this, asks, told = options.on_progress_](double fraction, std::string_view json) {
            workers_.resume(*asks.record_, [told, fraction, json = std::string{json}] { told(fraction, json); });
        });
    }
    // The job that asks keeps this alive, also where the answer comes after the end.
    by->delegate(command, chosen,
                 [this, asks, ticket](boost::system::error_code code, std::string_view json, std::string_view message) {
                     answer(ticket, code, json, message);
                 });
}

void onward_requests::answer(std::uint64_t ticket, boost::system::error_code code, std::string_view json,
                             std::string_view message) {
    const auto found = open_.find(ticket);
    if (found == open_.end()) {
        return;
    }
    const auto q = std::move(found->second);
    open_.erase(found);
    workers_.resume(*q.asks.record_, [answered = q.answered, code, json = std::string{json},
                                      message = std::string{message}] { answered(code, json, message); });
}

void onward_requests::close() {
    while (!open_.empty()) {
        answer(open_.begin()->first, errc::unavailable, "{}", "the node is stopping");
    }
}

} // namespace cles::runtime
