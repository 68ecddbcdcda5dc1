// SPDX-License-Identifier: BSL-1.0
#include "core/datagram_requests.hpp"

#include <string>

namespace cles::core {
namespace {

bool needs_id(verb v) noexcept { return v != verb::pull && v != verb::bind; }

// A withdrawal may be repeated, and acts even where there is no memory left.
bool runs_once(const protocol::request_line& r) noexcept { return needs_id(r.verb) && r.noun.task != "cles"; }

} // namespace

datagram_requests::datagram_requests(node& host, outlet& out, reply_writer& replies)
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
        replies_.fail_apart(reply_to{r}, {.code = errc::bad_request,
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

} // namespace cles::core
