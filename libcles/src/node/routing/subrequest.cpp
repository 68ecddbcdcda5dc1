// SPDX-License-Identifier: BSL-1.0
#include "node/routing/subrequest.hpp"

#include <string>
#include <utility>

namespace cles::core {
namespace {

// Whether the code of an error reply leaves it open that the handler has run.
bool handler_may_have_run(const protocol::failure& why) {
    switch (why.code) {
    case errc::bad_request:
    case errc::denied:
    case errc::no_target:
    case errc::no_task:
    case errc::busy: return why.ran;
    default: return true;
    }
}

// A failure to reach the node, or to receive its reply.
subrequest_failure on_the_way(boost::system::error_code code, std::string_view message) {
    subrequest_failure why{.told = {.code = errc::unavailable, .message = std::string{message}}};
    if (code == errc::unavailable || code == errc::stopped) {
        return why;
    }
    if (code == errc::deadline || code == errc::too_large || code == errc::cancelled) {
        why.told.code = static_cast<errc>(code.value());
        why.may_have_started = code != errc::too_large;
        return why;
    }
    if (code == errc::busy) { // from this node itself, which holds too much already
        why.told.code = errc::busy;
        why.may_have_started = false;
        return why;
    }
    if (code == errc::no_target) {
        why.told.code = errc::no_target;
    }
    why.may_have_started = false;
    why.unreachable = true;
    return why;
}

} // namespace

subrequest::verdict subrequest::offer(std::string_view json) {
    if (!detail::is_valid_answer(json)) {
        return verdict::malformed;
    }
    const std::unique_ptr<subrequest> self{this};
    to_->on_result(which_, json);
    return verdict::completed;
}

void subrequest::fail(boost::system::error_code code, std::string_view message) { end(on_the_way(code, message)); }

void subrequest::refuse(boost::system::error_code, std::string_view, std::string_view answer) {
    subrequest_failure why;
    protocol::parse_failure(answer, why.told);
    why.told.answer = answer;
    why.may_have_started = handler_may_have_run(why.told);
    end(std::move(why));
}

void subrequest::end(subrequest_failure why) {
    const std::unique_ptr<subrequest> self{this};
    to_->on_failure(which_, std::move(why));
}

std::uint64_t send_subrequest(next_hop& out, const protocol::request_line& r, std::string_view node,
                              std::string_view adverbs, time_point due, std::shared_ptr<subrequest_events> events,
                              std::size_t which) {
    outbound::progress_function progress;
    if (r.wants_progress && r.id != 0) {
        progress = [weak = std::weak_ptr{events}, which](double fraction, std::string_view json) {
            if (const auto alive = weak.lock()) {
                alive->on_progress(which, fraction, json);
            }
        };
    }
    std::string noun;
    noun.reserve(node.size() + 1 + r.noun.path.size());
    noun.append(node).append(":").append(r.noun.path);
    return out.send({.verb = r.verb, .noun = noun, .carried = r.carried(), .adverbs = adverbs, .body = r.body}, due,
                    detail::pending_ptr{new subrequest(std::move(events), which)}, std::move(progress));
}

protocol::failure named(subrequest_failure why, std::string_view node) {
    if (why.told.answer.empty() && !why.told.message.starts_with(node)) {
        why.told.message.insert(0, std::string{node} + ": ");
    }
    return std::move(why.told);
}

void forwarding::go(next_hop& out, const protocol::request_line& r, std::string_view own_name, time_point due) {
    const auto ticket = send_subrequest(out, r, node_, forwarded_adverbs(r, own_name), due, shared_from_this(), 0);
    call_->on_stop([&out, ticket] { out.cancel(ticket); });
}

void forwarding::on_result(std::size_t, std::string_view json) { call_->done(json); }

void forwarding::on_failure(std::size_t, subrequest_failure why) { call_->fail(named(std::move(why), node_)); }

void forwarding::on_progress(std::size_t, double fraction, std::string_view json) { call_->progress(fraction, json); }

} // namespace cles::core
