// SPDX-License-Identifier: BSL-1.0
#include "node/secured/secured_link.hpp"

#include "node/secured/roster_exchange.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <utility>

namespace cles::core {

secured_link::secured_link(std::shared_ptr<node_state> host, confirmed_epochs& confirmed, line_sink& out,
                           outbound& asking, const identity& peer, unconfirmed_updates::deliver_function deliver)
    : node_(std::move(host)), confirmed_(confirmed), out_(out), asking_(asking), peer_(peer),
      unconfirmed_(std::make_shared<unconfirmed_updates>(*node_, confirmed, asking, peer.transport == "pool",
                                                         std::move(deliver))) {}

bool secured_link::serve(const protocol::request_line& r, time_point now) {
    if (!is_hello(r)) {
        return false;
    }
    ++node_->counts.housekeeping;
    if (wants_stated_roster(*node_, peer_, r, now)) {
        const auto id = node_->next_id++;
        asking_.send({.verb = verb::pull, .noun = "self:cles/roster", .id = id},
                     now + std::chrono::milliseconds{protocol::default_deadline_ms}, now,
                     make_roster_reply(node_, peer_.name));
    }
    return true;
}

bool secured_link::admits(const protocol::request_line& update) {
    if (peer_.transport == "inproc") { // checked before: it comes from this process
        return true;
    }
    // What a node of another pool signs is known once its present incarnation has said so.
    if (peer_.transport == "pool" && !confirmed_.contain(update.noun.target, *update.epoch)) {
        unconfirmed_->hold(update, node_->time.now());
        return false;
    }
    if (node_->secured->check(update, peer_.name == update.noun.target) == update_check::refused) {
        ++node_->counts.updates_unsigned;
        return false;
    }
    // The peer has stated its own epoch when it proved its name. What it passes on may be of an earlier incarnation.
    if (update.noun.target == peer_.name || peer_.name == node_->name ||
        confirmed_.contain(update.noun.target, *update.epoch)) {
        return true;
    }
    unconfirmed_->hold(update, node_->time.now());
    return false;
}

void secured_link::send_hello() {
    const auto body = hello_body(*node_);
    protocol::append_request(out_.output(),
                             {.verb = verb::push, .noun = "self:cles/hello", .wants_reply = false, .body = body});
    out_.wake();
}

} // namespace cles::core
