// SPDX-License-Identifier: BSL-1.0
#include "core/forwarding.hpp"

#include <utility>

namespace cles::core {

std::uint64_t send_onward(onward& out, const protocol::request_line& r, std::string_view node, std::string_view adverbs,
                          time_point due, std::shared_ptr<leg_events> errand, std::size_t which) {
    outbound::progress_function progress;
    if (r.wants_progress && r.id != 0) {
        progress = [weak = std::weak_ptr{errand}, which](double fraction, std::string_view json) {
            if (const auto alive = weak.lock()) {
                alive->on_progress(which, fraction, json);
            }
        };
    }
    return out.send({.verb = r.verb,
                     .node = node,
                     .path = r.noun.path,
                     .adverbs = adverbs,
                     .body = r.body,
                     .urgent = r.urgent,
                     .deadline = due},
                    detail::pending_ptr{new leg(std::move(errand), which)}, std::move(progress));
}

protocol::failure named(leg_failure why, std::string_view node) {
    if (why.told.answer.empty() && !why.told.message.starts_with(node)) {
        why.told.message.insert(0, std::string{node} + ": ");
    }
    return std::move(why.told);
}

void forwarding::go(onward& out, const protocol::request_line& r, std::string_view own_name, time_point due) {
    const auto ticket = send_onward(out, r, node_, onward_adverbs(r, own_name), due, shared_from_this(), 0);
    call_->on_stop([&out, ticket] { out.withdraw(ticket); });
}

void forwarding::on_result(std::size_t, std::string_view json) { call_->done(json); }

void forwarding::on_failure(std::size_t, leg_failure why) { call_->fail(named(std::move(why), node_)); }

void forwarding::on_progress(std::size_t, double fraction, std::string_view json) { call_->progress(fraction, json); }

} // namespace cles::core
