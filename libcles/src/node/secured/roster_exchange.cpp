// SPDX-License-Identifier: BSL-1.0
#include "node/secured/roster_exchange.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "json/json_members.hpp"
#include "node/base/peer_reply.hpp"
#include "port/node_security.hpp"

#include <cstdint>
#include <limits>
#include <utility>

namespace cles::core {

bool is_hello(const protocol::request_line& r) noexcept {
    return r.verb == verb::push && !r.wants_reply && r.noun.target == "self" && r.noun.path == "cles/hello";
}

std::string hello_body(const node_state& n) {
    std::string text;
    json_writer w{text};
    w.begin_object();
    write_member(w, "version", std::uint64_t{n.security->roster_version()});
    write_member(w, "epoch", std::string_view{n.epoch});
    w.end_object();
    return text;
}

bool wants_stated_roster(const node_state& n, const identity& peer, const protocol::request_line& hello,
                         time_point now) {
    if (!n.security || peer.name.empty()) {
        return false;
    }
    std::uint64_t version = 0;
    json_reader reader{hello.body, n.bounds.depth};
    const bool valid = read_members(
        reader, [&](std::string_view key) { return key == "version" ? reader.read(version) : reader.skip(); });
    return valid && version <= std::numeric_limits<std::uint32_t>::max() &&
           n.security->wants_roster(peer.name, static_cast<std::uint32_t>(version), now);
}

detail::pending_ptr make_roster_reply(std::shared_ptr<node_state> host, std::string from) {
    auto then = [host = std::move(host), from = std::move(from)](const peer_answer& found) {
        if (found.code) {
            host->post_log(log_level::debug, "did not get the roster of " + from + ": " + std::string{found.message});
        } else if (const auto why = host->security->offer_roster(found.json)) {
            host->post_log(log_level::warning, "refused the roster of " + from + ": " + *why);
        }
    };
    return detail::pending_ptr{new peer_reply{std::move(then)}};
}

void serve_roster(node_state& host, reply_writer& replies, const protocol::request_line& r) {
    if (r.verb == verb::pull) {
        replies.done(reply_target{r}, host.security->roster_line());
    } else if (r.verb != verb::push) {
        replies.fail(r, errc::no_task, host.name + " has only PULL and PUSH 'cles/roster'");
    } else if (const auto why = host.security->offer_roster(r.body)) {
        replies.fail(r, errc::bad_request, host.name + ": " + *why);
    } else {
        replies.done(reply_target{r}, {});
    }
}

} // namespace cles::core
