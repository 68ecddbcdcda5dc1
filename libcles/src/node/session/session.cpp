// SPDX-License-Identifier: BSL-1.0
#include "node/session/session.hpp"

#include "node/membership/reachable_endpoints.hpp"
#include "node/session/request_checks.hpp"
#include "protocol/line.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {
namespace {

// Whether any of its lines is HTTP: a request, or a similar message (such as UPnP), has several.
bool is_web_datagram(std::string_view datagram) {
    while (!datagram.empty()) {
        const auto end = std::min(datagram.find('\n'), datagram.size());
        if (protocol::is_http(protocol::trim(datagram.substr(0, end)))) {
            return true;
        }
        datagram.remove_prefix(std::min(end + 1, datagram.size()));
    }
    return false;
}

// Whether the peer announces that it leaves: what it has not answered by then, it has not started (docs/protocol.md,
// "Leaving").
bool is_leave_notice(const protocol::request_line& r) noexcept {
    return r.verb == verb::push && !r.wants_reply && r.noun.target == "self" && r.noun.path == "cles/leaving";
}

} // namespace

session::session(std::shared_ptr<node_state> host, line_sink& out, subscriber& updates, const identity& peer)
    : node_(std::move(host)), out_(out), peer_(peer), inbound_(node_, out, updates, peer), outbound_(*node_, out) {
    if (node_->secured) {
        secured_ = node_->secured->on_link(node_, out_, outbound_, peer_, [this](std::string_view line) {
            protocol::request_line again;
            protocol::malformed_request ignored; // it was valid on arrival
            if (!closed_ && protocol::parse_request(line, again, ignored)) {
                on_update(subscriptions_.find(line, again));
            }
        });
    }
}

void session::on_line(std::string_view line, time_point now) {
    line = protocol::trim(line);
    if (line.empty() || closed_) {
        return;
    }
    if (out_.is_datagram() && protocol::has_many_lines(line)) {
        if (!is_web_datagram(line)) {
            refuse(line, "a datagram must contain one line");
        }
        return;
    }
    if (may_be_refused_ || !refusal_.empty()) {
        note_refusal(line);
    }
    if (const auto found = subscriptions_.recognise(line); found.update != nullptr) {
        on_update(found);
        return;
    }
    if (protocol::is_reply(line)) {
        on_reply(line);
        return;
    }
    if (protocol::is_http(line)) {
        if (out_.is_datagram()) { // web pages cannot send datagrams
            return;
        }
        node_->log_caused(
            {.level = log_level::warning, .kind = "web", .source = holder_of(peer_), .peer = peer_.address},
            [this] { return "rejected a web client: " + peer_.address; });
        on_lost("the peer speaks HTTP");
        out_.close();
        return;
    }
    protocol::request_line request;
    protocol::malformed_request malformed;
    if (!protocol::parse_request(line, request, malformed)) {
        inbound_.on_malformed(malformed);
    } else if (request.is_update()) {
        on_update(subscriptions_.find(line, request));
    } else if (!out_.is_datagram() && is_leave_notice(request)) {
        on_leaving();
    } else if (!secured_ || !secured_->serve(request, now)) {
        inbound_.on_request(line, request, now);
    }
}

// A `busy` without id refuses the link if it is the only line that ever arrives.
void session::note_refusal(std::string_view line) {
    const bool first = std::exchange(may_be_refused_, false);
    refusal_.clear();
    protocol::failure why;
    if (first && protocol::is_failure(line) && protocol::parse_failure(line, why) && why.code == errc::busy &&
        !why.ran) {
        refusal_ = line;
    }
}

void session::lose_requests(std::string_view why) {
    if (refusal_.empty()) {
        outbound_.lose(errc::unavailable, why);
    } else {
        outbound_.refuse(refusal_);
    }
}

void session::on_reply(std::string_view line) {
    protocol::reply_line reply;
    if (!protocol::parse_reply(line, reply) || reply.id == 0) {
        drop_reply(refusal_.empty() ? "it has no valid head" : ""); // a refusal of the link answers no request
    } else if (!outbound_.on_reply(reply)) {
        drop_reply(node_->log ? why_unreadable(reply.body) : "");
    }
}

void session::drop_reply(std::string_view why) {
    ++node_->counts.replies_dropped;
    if (!node_->log) {
        return;
    }
    node_->log_drop(holder_of(peer_), "a reply", why.empty() ? "nobody waits for it" : why, !why.empty());
}

void session::on_update(const subscriptions::match& found) {
    const auto& update = *found.update;
    if (secured_ && found.whose != nullptr && !secured_->admits(update)) {
        return;
    }
    if (found.whose == nullptr || protocol::begins_with_error(update.body) || !subscriptions_.deliver(found)) {
        drop_update(found);
    } else {
        ++node_->counts.updates_received;
    }
}

void session::drop_update(const subscriptions::match& found) {
    ++node_->counts.updates_dropped;
    const auto& body = found.update->body;
    if (!node_->log) {
        return;
    }
    if (found.whose == nullptr) {
        node_->log_drop(holder_of(peer_), "an update", "nobody here has bound it", false);
    } else if (protocol::begins_with_error(body)) {
        node_->log_drop(holder_of(peer_), "an update", "its first key is 'error'", true);
    } else {
        const auto why = why_unreadable(body);
        node_->log_drop(holder_of(peer_), "an update", why.empty() ? "it is old, or repeated" : why, !why.empty());
    }
}

void session::on_leaving() {
    ++node_->counts.requests[static_cast<std::size_t>(verb::push)];
    out_.retire();
    outbound_.refuse(
        failure_text({.code = errc::busy,
                      .message = "the node at " + peer_.address + " is leaving, and has not started this request",
                      .retry_ms = 1000}));
}

void session::send_hello() {
    if (secured_ && !closed_) {
        secured_->send_hello();
    }
}

void session::send_leave_notice() {
    if (!out_.is_datagram() && !std::exchange(closed_, true)) {
        protocol::append_request(out_.output(),
                                 {.verb = verb::push, .noun = "self:cles/leaving", .wants_reply = false});
        out_.finish();
    }
}

// The id for the reply is in the first line.
void session::refuse(std::string_view text, const char* why) {
    if (protocol::is_reply(text)) {
        drop_reply(why);
        return;
    }
    auto meant = protocol::salvage(protocol::trim(text.substr(0, text.find('\n'))));
    meant.why = why;
    inbound_.on_malformed(meant);
}

void session::reject(std::string_view line) {
    line = protocol::trim(line);
    const auto meant = protocol::salvage(line);
    if (!line.empty() && !protocol::is_reply(line) && meant.wants_reply) {
        append_link_refusal(out_.output(), *node_, meant.id);
    }
}

void session::on_overlong(std::string_view head) {
    may_be_refused_ = false;
    refusal_.clear();
    head = protocol::trim(head);
    if (out_.is_datagram() && is_web_datagram(head)) {
        return;
    }
    if (!protocol::is_reply(head)) {
        inbound_.on_overlong(head);
        return;
    }
    drop_reply("it is longer than the limit");
    if (out_.is_datagram()) {
        return;
    }
    protocol::reply_line reply;
    protocol::parse_reply(head, reply);
    if (reply.id != 0) {
        outbound_.on_overlong(reply);
    }
    closed_ = true;
    out_.finish();
}

// The line may be incomplete, so it is not run.
void session::on_cut(std::string_view rest) {
    rest = protocol::trim(rest);
    if (!rest.empty() && !closed_) {
        refuse(rest, "the last line does not end with LF");
    }
}

void session::on_end() {
    inbound_.end();
    lose_requests("the peer ended the link before it answered");
}

void session::on_lost(std::string_view why) {
    closed_ = true;
    inbound_.lose();
    lose_requests(why);
}

} // namespace cles::core
