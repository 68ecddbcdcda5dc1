// SPDX-License-Identifier: BSL-1.0
#include "node/session/outbound.hpp"

#include "node/session/peer_description.hpp"
#include "node/session/request_checks.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

// Whether the peer is told if a request ends without its reply, also at the deadline: the peer's own began later, and
// its job, or that of a node to which it has forwarded the request, would run on. Requests that this node forwards are
// those that state `via`. A program's own request other than a job is short, and the peer ends it by itself.
bool is_end_told(const protocol::outgoing_request& r) {
    return r.verb == verb::delegate || r.adverbs.find(" via=") != std::string_view::npos;
}

} // namespace

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
    e->describes = request.verb == verb::pull && request.noun == "self:cles";
    e->end_is_told = is_end_told(request);
    request.id += first_id_;
    auto& out = out_.output();
    const auto line = out.size();
    const bool has_memory = has_memory_for(request);
    protocol::append_request(out, request);
    e->operation = std::move(operation);
    e->progress = std::move(progress);
    const auto size = out.size() - line;
    if (size > longest()) {
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
        if (must_wait(size)) {
            e->held = out.substr(line);
            out.resize(line);
            held_.push_back(e->id);
            held_bytes_ += size;
        }
        node_.deadlines.arm(*e, deadline);
    }
    waiting_.emplace(e->id, std::move(e));
    ++node_.counts.requests_sent;
    out_.wake();
}

// Small requests always fit, as do those for the reserved task.
bool outbound::has_memory_for(const protocol::outgoing_request& r) {
    constexpr std::size_t always_fits = 1024;
    return r.size() <= always_fits || r.is_reserved() || out_.reserve(held_bytes_ + r.size() + always_fits);
}

// The limits hold on a stream too: the peer would close the link, and cancel the other requests on it.
std::size_t outbound::longest() const noexcept {
    return out_.is_datagram() ? out_.datagram() : std::min(node_.bounds.line, peer_line_) + 1;
}

std::string outbound::too_large_reason() const {
    if (out_.is_datagram()) {
        return "a request by datagram has at most " + std::to_string(out_.datagram()) + " bytes: use TCP";
    }
    if (peer_line_ < node_.bounds.line) {
        return (peer_.empty() ? std::string{"the node there"} : peer_) + " reads requests of at most " +
               std::to_string(peer_line_) + " bytes (its limits.line)";
    }
    return "a request has at most " + std::to_string(node_.bounds.line) + " bytes (limits.line)";
}

bool outbound::must_wait(std::size_t size) const noexcept {
    return holds_ && (size > peer_description::least_line + 1 || !held_.empty());
}

void outbound::release(std::string_view peer, std::optional<std::size_t> line) {
    peer_ = peer;
    peer_line_ = line.value_or(std::numeric_limits<std::size_t>::max());
    holds_ = false;
    const auto ids = std::exchange(held_, {});
    for (const auto id : ids) {
        const auto found = waiting_.find(id);
        if (found == waiting_.end() || found->second->held.empty()) { // it has ended
            continue;
        }
        auto& e = *found->second;
        const auto text = std::exchange(e.held, {});
        held_bytes_ -= text.size();
        if (text.size() <= longest()) {
            out_.output().append(text);
        } else {
            e.refused = errc::too_large;
            node_.deadlines.arm(e, node_.time.now());
        }
    }
    if (!ids.empty()) {
        out_.wake();
    }
}

void outbound::on_due(entry& e, time_point now) {
    if (e.refused == errc::too_large) {
        fail(e.id, errc::too_large, too_large_reason());
    } else if (e.refused) {
        fail(e.id, errc::busy, "no memory is left for requests that are not sent yet (limits.memory)");
    } else if (e.copies && !e.copies->over(now)) {
        out_.check_peer(e.copies->sent());
        resend(e, now);
    } else {
        if (e.end_is_told && e.held.empty()) {
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

std::unique_ptr<outbound::entry> outbound::take(entries::iterator which) {
    if (which == waiting_.end()) {
        return nullptr;
    }
    auto e = std::move(which->second);
    waiting_.erase(which);
    held_bytes_ -= e->held.size();
    node_.deadlines.disarm(*e);
    return e;
}

std::unique_ptr<outbound::entry> outbound::take(std::uint64_t id) { return take(waiting_.find(id)); }

// A smaller id wraps around and matches no request.
std::unique_ptr<outbound::entry> outbound::take_answered(std::uint64_t link_id) {
    const auto found = waiting_.find(link_id - first_id_);
    const bool is_sent = found != waiting_.end() && found->second->held.empty() && !found->second->refused;
    return is_sent ? take(found) : nullptr;
}

outbound::entries outbound::take_all() {
    held_bytes_ = 0;
    return std::exchange(waiting_, {});
}

void outbound::recycle(std::unique_ptr<entry> e) {
    constexpr std::size_t enough = 256;
    if (spare_.size() < enough) {
        e->progress = nullptr;
        e->reported = 0;
        e->copies.reset();
        e->refused.reset();
        std::string{}.swap(e->held); // it may be long
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
    const auto found = waiting_.find(id);
    if (found == waiting_.end()) {
        return false;
    }
    if (found->second->held.empty()) {
        cancel_at_peer(id);
    }
    fail(id, errc::cancelled, "the request was cancelled");
    return true;
}

std::string outbound::cancel_noun(std::uint64_t id) const {
    return "self:cles/cancel/" + std::to_string(id + first_id_);
}

void outbound::cancel_at_peer(std::uint64_t id) {
    const auto noun = cancel_noun(id);
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

bool outbound::on_failure(const protocol::reply_line& reply) {
    protocol::failure why;
    const bool ends = std::exchange(ends_after_long_line_, false);
    if (!protocol::parse_failure(reply.body, why)) {
        return false;
    }
    const bool is_withdrawn = ends && why.code == errc::cancelled;
    ends_after_long_line_ = !out_.is_datagram() && (is_withdrawn || (why.code == errc::too_large && !why.ran));
    auto e = take_answered(reply.id);
    if (!e) {
        return false;
    }
    auto* operation = e->operation.release();
    const auto progress = std::move(e->progress); // user code too: destroyed after the operation has completed
    recycle(std::move(e));
    node_.completions.now([&] {
        if (is_withdrawn) {
            operation->fail(errc::unavailable, "the node there has ended the link, because another request on it was "
                                               "longer than it reads (its limits.line)");
        } else {
            operation->refuse(why.code, why.message, reply.body);
        }
    });
    return true;
}

bool outbound::on_reply(const protocol::reply_line& reply) {
    if (!reply.progress && protocol::is_failure(reply.body)) {
        return on_failure(reply);
    }
    ends_after_long_line_ = false;
    auto e = take_answered(reply.id);
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
    } else {
        if (e->describes && detail::is_valid_answer(reply.body)) {
            out_.on_described(reply.body);
        }
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
    if (const auto e = take_answered(reply.id)) {
        const protocol::failure why{.code = errc::too_large,
                                    .message = "the answer is longer than " + std::to_string(node_.bounds.line) +
                                               " bytes (limits.line)",
                                    .ran = true};
        node_.completions.refuse(std::move(e->operation), why, failure_text(why), std::move(e->progress));
    }
}

void outbound::refuse(const std::string& answer) {
    protocol::failure why;
    protocol::parse_failure(answer, why);
    const auto lost = take_all();
    for (const auto& [id, e] : lost) {
        node_.deadlines.disarm(*e);
        node_.completions.refuse(std::move(e->operation), why, answer, std::move(e->progress));
    }
}

void outbound::lose(errc why, std::string_view message) {
    const auto lost = take_all();
    const std::string text{message};
    for (const auto& [id, e] : lost) {
        node_.deadlines.disarm(*e);
        node_.completions.fail(std::move(e->operation), why, text, std::move(e->progress));
    }
}

void outbound::stop() {
    for (const auto& [id, e] : take_all()) {
        if (out_.is_datagram() && e->end_is_told && !e->refused) { // once: nobody is left to send it again
            const auto noun = cancel_noun(id);
            protocol::append_request(
                out_.output(),
                {.verb = verb::push, .noun = noun, .id = first_id_ + node_.next_id++, .wants_reply = false});
        }
        node_.deadlines.disarm(*e);
        node_.completions.put(completion{completion::failure{std::move(e->operation), errc::stopped,
                                                             "the service has been stopped", std::move(e->progress)}});
    }
}

} // namespace cles::core
