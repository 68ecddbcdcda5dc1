// SPDX-License-Identifier: BSL-1.0
#include "node/session/outbound.hpp"

#include "node/session/request_checks.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

void outbound::send(protocol::outgoing_request request, time_point deadline, time_point now,
                    detail::pending_ptr operation, progress_function progress) {
    std::unique_ptr<entry> e;
    if (spare_.empty()) {
        e = std::make_unique<entry>(*this);
    } else {
        e = std::move(spare_.back());
        spare_.pop_back();
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - now).count();
    const auto deadline_ms = static_cast<std::uint32_t>(
        std::clamp<std::int64_t>(left, 1, static_cast<std::int64_t>(protocol::max_deadline_ms)));
    request.deadline_ms = deadline_ms == protocol::default_deadline(request.verb) ? 0 : deadline_ms;
    request.wants_progress = static_cast<bool>(progress);
    e->id = request.id;
    e->verb = request.verb;
    request.id += first_id_;
    auto& out = out_.output();
    const auto line = out.size();
    const bool has_memory = has_memory_for(request);
    protocol::append_request(out, request);
    e->operation = std::move(operation);
    e->progress = std::move(progress);
    if (out.size() - line > longest()) {
        e->refused = errc::too_large;
    } else if (!has_memory) {
        e->refused = errc::busy;
    }
    if (e->refused) {
        out.resize(line);
        node_.deadlines.arm(*e, now); // fails later: no operation completes inside its initiation
    } else if (out_.is_datagram()) {
        e->copies.emplace(out.substr(line), now, deadline,
                          static_cast<std::uint32_t>((e->id + first_id_) * 2654435761U));
        node_.deadlines.arm(*e, e->copies->next());
    } else {
        node_.deadlines.arm(*e, deadline);
    }
    waiting_.emplace(e->id, std::move(e));
    ++node_.counts.requests_sent;
    out_.wake();
}

// Small requests always fit, as do those for the reserved task.
bool outbound::has_memory_for(const protocol::outgoing_request& r) {
    constexpr std::size_t always_fits = 1024;
    return r.size() <= always_fits || r.is_reserved() || out_.reserve(r.size() + always_fits);
}

// The limit holds on a stream too: the peer would close the link, and cancel the other requests on it.
std::size_t outbound::longest() const noexcept { return out_.is_datagram() ? out_.datagram() : node_.bounds.line + 1; }

void outbound::on_due(entry& e, time_point now) {
    if (e.refused == errc::too_large) {
        fail(e.id, errc::too_large,
             out_.is_datagram()
                 ? "a request by datagram has at most " + std::to_string(out_.datagram()) + " bytes: use TCP"
                 : "a request has at most " + std::to_string(node_.bounds.line) + " bytes");
    } else if (e.refused) {
        fail(e.id, errc::busy, "no memory is left for requests that are not sent yet (limits.memory)");
    } else if (e.copies && !e.copies->over(now)) {
        out_.check_peer(e.copies->sent());
        resend(e, now);
    } else {
        if (e.verb == verb::delegate) { // the peer's deadline began later, and its job would run on
            cancel_at_peer(e.id);
        }
        fail(e.id, errc::deadline, "no answer was received in time");
    }
}

void outbound::resend(entry& e, time_point now) {
    out_.output().append(e.copies->again(now));
    ++node_.counts.requests_resent;
    node_.deadlines.arm(e, e.copies->next());
    out_.wake();
}

void outbound::on_restart(time_point now) {
    std::vector<std::uint64_t> lost;
    for (const auto& [id, e] : waiting_) {
        if (e->refused) {
            continue;
        }
        if (e->copies && (e->verb == verb::pull || e->verb == verb::bind)) {
            resend(*e, now);
        } else {
            lost.push_back(id);
        }
    }
    for (const auto id : lost) {
        fail(id, errc::unavailable, "the node has restarted, and may have run the request before");
    }
}

std::unique_ptr<outbound::entry> outbound::take(std::uint64_t id) {
    const auto found = waiting_.find(id);
    if (found == waiting_.end()) {
        return nullptr;
    }
    auto e = std::move(found->second);
    waiting_.erase(found);
    node_.deadlines.disarm(*e);
    return e;
}

void outbound::recycle(std::unique_ptr<entry> e) {
    constexpr std::size_t enough = 256;
    if (spare_.size() < enough) {
        e->progress = nullptr;
        e->reported = 0;
        e->copies.reset();
        e->refused.reset();
        spare_.push_back(std::move(e));
    }
}

void outbound::fail(std::uint64_t id, errc why, std::string_view message) {
    if (auto e = take(id)) {
        auto operation = std::move(e->operation);
        auto progress = std::move(e->progress);
        recycle(std::move(e));
        node_.completions.fail(std::move(operation), why, message, std::move(progress));
    }
}

bool outbound::cancel(std::uint64_t id) {
    if (!waiting_.contains(id)) {
        return false;
    }
    cancel_at_peer(id);
    fail(id, errc::cancelled, "the request was cancelled");
    return true;
}

void outbound::cancel_at_peer(std::uint64_t id) {
    const auto noun = "self:cles/cancel/" + std::to_string(id + first_id_);
    if (out_.is_datagram()) { // it may be lost
        const auto now = node_.time.now();
        send({.verb = verb::push, .noun = noun, .id = node_.next_id++},
             now + std::chrono::milliseconds{protocol::default_deadline_ms}, now,
             detail::pending_ptr{new discarded_reply});
    } else {
        protocol::append_request(out_.output(), {.verb = verb::push, .noun = noun, .wants_reply = false});
        out_.wake();
    }
}

void outbound::drop(std::uint64_t id) {
    if (auto e = take(id)) {
        e->operation.reset();
        recycle(std::move(e));
    }
}

void outbound::rearm(std::unique_ptr<entry> e, time_point due) {
    const auto id = e->id;
    node_.deadlines.arm(*e, due);
    waiting_.emplace(id, std::move(e));
}

bool outbound::on_reply(const protocol::reply_line& reply) {
    auto e = take(reply.id - first_id_); // a smaller id wraps around and matches no request
    if (!e) {
        return false;
    }
    const auto due = e->due();
    bool ended = false;
    if (reply.progress) {
        if (e->progress && detail::is_valid_answer(reply.body)) {
            // Called through a copy: it may cancel its own request.
            const auto report = e->progress;
            const bool late = *reply.progress < e->reported; // datagrams may be reordered
            e->reported = std::max(e->reported, *reply.progress);
            rearm(std::move(e), due);
            if (!late) {
                node_.completions.now([&] { report(*reply.progress, reply.body); });
            }
            return true;
        }
    } else if (protocol::is_failure(reply.body)) {
        protocol::failure why;
        if (protocol::parse_failure(reply.body, why)) {
            auto* operation = e->operation.release();
            const auto progress = std::move(e->progress); // user code too: destroyed after the operation has completed
            recycle(std::move(e));
            node_.completions.now([&] { operation->refuse(why.code, why.message, reply.body); });
            return true;
        }
    } else {
        auto* operation = e->operation.release();
        ended = true; // an exception comes from its handler
        node_.completions.now([&] {
            ended = (reply.mark         ? operation->offer_marked(reply.body, *reply.mark)
                     : reply.grant != 0 ? operation->offer_granted(reply.body, reply.grant)
                                        : operation->offer(reply.body)) == detail::pending::verdict::completed;
        });
        if (!ended) {
            e->operation.reset(operation);
        }
    }
    if (ended) {
        const auto progress = std::move(e->progress);
        recycle(std::move(e));
    } else {
        rearm(std::move(e), due);
    }
    return ended;
}

void outbound::on_overlong(const protocol::reply_line& reply) {
    if (const auto e = take(reply.id - first_id_)) {
        const protocol::failure why{.code = errc::too_large,
                                    .message =
                                        "the answer is longer than " + std::to_string(node_.bounds.line) + " bytes",
                                    .ran = true};
        node_.completions.refuse(std::move(e->operation), why, failure_text(why), std::move(e->progress));
    }
}

void outbound::refuse(const std::string& answer) {
    protocol::failure why;
    protocol::parse_failure(answer, why);
    const auto lost = std::exchange(waiting_, {});
    for (const auto& [id, e] : lost) {
        node_.deadlines.disarm(*e);
        node_.completions.refuse(std::move(e->operation), why, answer, std::move(e->progress));
    }
}

void outbound::lose(errc why, std::string_view message) {
    const auto lost = std::exchange(waiting_, {});
    const std::string text{message};
    for (const auto& [id, e] : lost) {
        node_.deadlines.disarm(*e);
        node_.completions.fail(std::move(e->operation), why, text, std::move(e->progress));
    }
}

void outbound::stop() {
    for (const auto& [id, e] : std::exchange(waiting_, {})) {
        node_.deadlines.disarm(*e);
        node_.completions.put(completion{completion::failure{std::move(e->operation), errc::stopped,
                                                             "the service has been stopped", std::move(e->progress)}});
    }
}

} // namespace cles::core
