// SPDX-License-Identifier: BSL-1.0
#include "node/secured/unconfirmed_updates.hpp"

#include "node/membership/reachable_endpoints.hpp"
#include "node/secured/epoch_confirmation.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {

void unconfirmed_updates::hold(const protocol::request_line& update, time_point now) {
    const auto& line = update.text;
    if (held_.size() >= max_lines || bytes_ + line.size() > max_bytes) {
        drop("too many wait for their publishers to confirm their epochs");
        return;
    }
    bytes_ += line.size();
    held_.push_back({.publisher = std::string{update.noun.target}, .epoch = *update.epoch, .line = std::string{line}});
    if (!asked_.contains(update.noun.target)) {
        ask_for_held(held_.back().publisher, now);
    }
}

// Now, or as soon as that node may be asked again.
void unconfirmed_updates::ask_for_held(const std::string& publisher, time_point now) {
    if (const auto next = confirmed_.next_question(publisher); next > now) {
        if (!armed() || next < due()) {
            node_.deadlines.arm(*this, next);
        }
        return;
    }
    asked_.insert(publisher);
    for (auto& each : held_) {
        each.asked = each.asked || each.publisher == publisher;
    }
    ask(publisher, now + std::chrono::milliseconds{protocol::default_deadline_ms}, now,
        [weak = weak_from_this(), publisher](const peer_answer& found) {
            if (const auto self = weak.lock()) {
                self->on_answered_for_held(publisher, found.code ? found.message : std::string_view{});
            }
        });
}

void unconfirmed_updates::ask(const std::string& publisher, time_point due, time_point now, peer_reply::function then) {
    confirmed_.on_asked(publisher, now);
    const auto challenge = node_.security->new_challenge();
    const auto noun = epoch_question(publisher, challenge);
    auto take = [weak = weak_from_this(), publisher, challenge, then = std::move(then)](const peer_answer& found) {
        const auto self = weak.lock();
        const bool is_unsecured = found.code == errc::no_task; // every member of a fleet has this one
        if (is_unsecured || (!found.code && !(self && self->take_answer(publisher, challenge, found.json)))) {
            const auto why = publisher + " does not confirm its epoch with its signature, so its updates do not count";
            then({.code = errc::unavailable, .message = why});
        } else {
            then(found);
        }
    };
    outbound_.send({.verb = verb::pull, .noun = noun, .id = node_.next_id++}, due, now,
                   detail::pending_ptr{new peer_reply{std::move(take)}});
}

bool unconfirmed_updates::take_answer(const std::string& publisher, std::string_view challenge, std::string_view json) {
    auto said = read_confirmed_epoch(json, member_of(node_, publisher), challenge, *node_.security);
    if (!said) {
        return false;
    }
    const auto now = node_.time.now();
    confirmed_.confirm(publisher, std::move(*said), now);
    if (!held_.empty()) { // delivered in a turn of its own, since this may be inside the processing of a line
        node_.deadlines.arm(*this, now);
    }
    return true;
}

// Those that arrived later are asked for next.
void unconfirmed_updates::on_answered_for_held(const std::string& publisher, std::string_view failure) {
    asked_.erase(publisher);
    const auto why =
        publisher + (failure.empty() ? " runs in another epoch" : " was asked for its epoch: ") + std::string{failure};
    std::erase_if(held_, [&](const held_update& each) {
        if (!each.asked || each.publisher != publisher || confirmed_.contain(publisher, each.epoch)) {
            return false;
        }
        bytes_ -= each.line.size();
        drop(why);
        return true;
    });
    if (!held_.empty()) {
        node_.deadlines.arm(*this, node_.time.now());
    }
}

void unconfirmed_updates::drop(std::string_view why) {
    ++node_.counts.updates_dropped;
    node_.log_drop(holder_of(peer_), "an update", why, true);
}

void unconfirmed_updates::on_deadline(time_point now) {
    const auto keep = shared_from_this(); // user code may close the link
    if (!deliver_confirmed()) {
        return;
    }
    std::set<std::string> waiting;
    for (const auto& each : held_) {
        if (!asked_.contains(each.publisher)) {
            waiting.insert(each.publisher);
        }
    }
    for (const auto& publisher : waiting) {
        ask_for_held(publisher, now);
    }
}

bool unconfirmed_updates::deliver_confirmed() {
    std::list<held_update> ready;
    for (auto at = held_.begin(); at != held_.end();) {
        const auto next = std::next(at);
        if (confirmed_.contain(at->publisher, at->epoch)) {
            bytes_ -= at->line.size();
            ready.splice(ready.end(), held_, at);
        }
        at = next;
    }
    for (const auto& each : ready) {
        if (weak_from_this().use_count() == 1) { // only the caller still has it
            return false;
        }
        deliver_(each.line);
    }
    return weak_from_this().use_count() != 1;
}

} // namespace cles::core
