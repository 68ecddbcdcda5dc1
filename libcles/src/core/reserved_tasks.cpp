// SPDX-License-Identifier: BSL-1.0
#include "core/reserved_tasks.hpp"

#include "core/gossip_answers.hpp"
#include "core/plain_table.hpp"
#include "core/teller.hpp"

#include <string>

namespace cles::core {
namespace {

void serve_peers(node& host, reply_writer& replies, const protocol::request_line& r) {
    const auto now = host.time.now();
    if (r.since.empty() || host.talk == nullptr) {
        replies.write(r, [&](json_writer& w) { write_peers(w, host.others, now); });
        return;
    }
    replies.write(r, [&](json_writer& w) { host.talk->write_news(w, {r.since, r.describe}, replies.longest(), now); });
}

} // namespace

void serve_reserved(node& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
    const auto& parameters = r.noun.parameters;
    if (r.verb == verb::pull && parameters.empty()) {
        replies.write(r, [&](json_writer& w) { write_description(w, host); });
    } else if (r.verb == verb::pull && parameters.size() == 1 && parameters[0] == "metrics") {
        replies.write(r, [&](json_writer& w) { write_metrics(w, host); });
    } else if (r.verb == verb::pull && parameters.size() == 1 && parameters[0] == "peers") {
        serve_peers(host, replies, r);
    } else if (r.verb == verb::push && parameters.size() == 1 && parameters[0] == "peers" && host.talk != nullptr) {
        if (host.talk->on_told(r.body, teller::of(peer), host.time.now())) {
            replies.done(reply_to{r}, {});
        } else {
            replies.fail(r, errc::bad_request, host.name + ": the body is no table of nodes");
        }
    } else if (r.verb == verb::push && parameters.size() == 2 && parameters[0] == "cancel") {
        replies.fail(r, errc::bad_request, host.name + ": cancel needs an id from 1 to 2^63-1");
    } else {
        replies.fail(r, errc::no_task,
                     host.name + " has no " + std::string{to_string(r.verb)} + " '" + std::string{r.noun.path} + "'");
    }
}

} // namespace cles::core
