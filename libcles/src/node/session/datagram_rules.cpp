// SPDX-License-Identifier: BSL-1.0
#include "node/session/datagram_rules.hpp"

#include <string>

namespace cles::core {
namespace {

bool needs_id(verb v) noexcept { return v != verb::pull && v != verb::bind; }

// A cancellation may be repeated, and takes effect even if no memory is left.
bool runs_once(const protocol::request_line& r) noexcept { return needs_id(r.verb) && r.noun.task != "cles"; }

} // namespace

datagram_requests::datagram_requests(node_state& host, line_sink& out, reply_writer& replies)
    : node_(host), out_(out), replies_(replies), seen_(host.deadlines, host.remembered) {
    replies_.remember(seen_);
}

bool datagram_requests::admit(const protocol::request_line& r) {
    if (r.id == 0) {
        if (needs_id(r.verb)) {
            replies_.fail(r, errc::bad_request,
                          node_.name + ": by datagram, " + std::string{to_string(r.verb)} + " needs an 'id'");
            return false;
        }
        return true;
    }
    switch (seen_.look(r.id, r.text)) {
    case dedup::verdict::fresh: break;
    case dedup::verdict::running: ++node_.counts.requests_repeated; return false;
    case dedup::verdict::answered:
        ++node_.counts.requests_repeated;
        out_.output().append(seen_.reply(r.id, r.text));
        return false;
    case dedup::verdict::clash:
        replies_.fail_apart(reply_target{r}, {.code = errc::bad_request,
                                              .message = node_.name + ": the id " + std::to_string(r.id) +
                                                         " is in flight with another request"});
        return false;
    }
    if (runs_once(r) && !seen_.begin(r.id, r.text, out_.datagram())) {
        replies_.fail(r, {.code = errc::busy,
                          .message = node_.name + " remembers as many requests by datagram as it may",
                          .retry_ms = 1000});
        return false;
    }
    return true;
}

void datagram_output::append_updates(std::string& out, std::string_view lines) {
    while (!lines.empty()) {
        const auto size = lines.find('\n') + 1; // updates are whole lines
        if (size <= max_datagram_) {
            out.append(lines.substr(0, size));
        } else {
            ++node_.counts.updates_too_large;
        }
        lines.remove_prefix(size);
    }
}

void datagram_output::limit(std::string& out, time_point now) {
    if (unverified_address_.empty()) {
        return;
    }
    std::size_t kept = 0;
    for (std::size_t at = 0; at < out.size();) {
        const auto size = out.find('\n', at) + 1 - at;
        if (node_.reflection.admit(unverified_address_, size + headers_, now)) {
            out.replace(kept, size, out, at, size);
            kept += size;
        } else {
            ++node_.counts.datagrams_withheld;
        }
        at += size;
    }
    out.resize(kept);
}

} // namespace cles::core
