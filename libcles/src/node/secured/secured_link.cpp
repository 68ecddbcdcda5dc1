// SPDX-License-Identifier: BSL-1.0
#include "node/secured/secured_link.hpp"

#include "node/membership/reachable_endpoints.hpp"
#include "node/secured/roster_exchange.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <string>
#include <utility>

namespace cles::core {

secured_link::secured_link(std::shared_ptr<node_state> host, confirmed_epochs& confirmed, line_sink& out,
                           outbound& asking, const identity& peer, unconfirmed_updates::deliver_function deliver)
    : node_(std::move(host)), confirmed_(confirmed), out_(out), asking_(asking), peer_(peer),
      unconfirmed_(std::make_shared<unconfirmed_updates>(*node_, confirmed, asking, peer, std::move(deliver))) {}

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
    // The peer has stated its own epoch when it proved its name. What it passes on may be of an earlier incarnation;
    // and what the publisher signs is known, without its announcement, once its present incarnation has said so.
    const auto publisher = update.noun.target;
    const bool is_direct = publisher == peer_.name;
    if (!is_direct && !confirmed_.contain(publisher, *update.epoch)) {
        // Only a member can confirm its epoch: names that a node makes up cause no questions, and displace no epoch.
        if (node_->security->is_member(member_of(*node_, publisher))) {
            unconfirmed_->hold(update, node_->time.now());
        } else {
            refuse(std::string{publisher} + " is not in the roster");
        }
        return false;
    }
    if (node_->secured->check(update, is_direct) == update_check::refused) {
        refuse("it is not signed as " + std::string{publisher} + " has stated");
        return false;
    }
    return true;
}

void secured_link::refuse(const std::string& why) {
    ++node_->counts.updates_unsigned;
    node_->log_drop(holder_of(peer_), "an update", why, true);
}

void secured_link::ask(const std::string& publisher, time_point due, peer_reply::function then) {
    unconfirmed_->ask(publisher, due, node_->time.now(), std::move(then));
}

void secured_link::send_hello() {
    const auto body = hello_body(*node_);
    protocol::append_request(out_.output(),
                             {.verb = verb::push, .noun = "self:cles/hello", .wants_reply = false, .body = body});
    out_.wake();
}

} // namespace cles::core
