// SPDX-License-Identifier: BSL-1.0
#include "node/secured/unconfirmed_updates.hpp"

#include "node/base/peer_reply.hpp"
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
        ++node_.counts.updates_dropped;
        return;
    }
    bytes_ += line.size();
    held_.push_back({.publisher = std::string{update.noun.target}, .epoch = *update.epoch, .line = std::string{line}});
    if (!asked_.contains(update.noun.target)) {
        ask(held_.back().publisher, now);
    }
}

// Now, or as soon as that node may be asked again.
void unconfirmed_updates::ask(const std::string& publisher, time_point now) {
    if (const auto next = confirmed_.next_question(publisher); next > now) {
        if (!armed() || next < due()) {
            node_.deadlines.arm(*this, next);
        }
        return;
    }
    confirmed_.on_asked(publisher, now);
    asked_.insert(publisher);
    for (auto& each : held_) {
        each.asked = each.asked || each.publisher == publisher;
    }
    const auto challenge = node_.security->new_challenge();
    const auto noun = epoch_question(publisher, challenge);
    auto then = [weak = weak_from_this(), publisher, challenge](const peer_answer& found) {
        if (const auto self = weak.lock()) {
            const auto member = member_of(self->node_, publisher);
            self->on_answer(publisher,
                            found.code ? std::nullopt
                                       : read_confirmed_epoch(found.json, member, challenge, *self->node_.security));
        }
    };
    outbound_.send({.verb = verb::pull, .noun = noun, .id = node_.next_id++},
                   now + std::chrono::milliseconds{protocol::default_deadline_ms}, now,
                   detail::pending_ptr{new peer_reply{std::move(then)}});
}

// Delivered in a turn of its own, since this may be inside the processing of a line.
void unconfirmed_updates::on_answer(const std::string& publisher, std::optional<confirmed_epoch> said) {
    const auto now = node_.time.now();
    asked_.erase(publisher);
    const bool is_confirmed = said.has_value();
    const auto epoch = is_confirmed ? said->epoch : 0;
    if (said) {
        if (!crosses_pools_) { // its announcement tells, unless it is of another pool, too
            const auto* const before = confirmed_.find(publisher);
            const bool is_same = before != nullptr && before->epoch == said->epoch;
            said->signed_tasks = is_same ? before->signed_tasks : std::nullopt;
        }
        confirmed_.confirm(publisher, std::move(*said), now);
    }
    std::erase_if(held_, [&](const held_update& each) {
        if (!each.asked || each.publisher != publisher || (is_confirmed && epoch == each.epoch)) {
            return false;
        }
        bytes_ -= each.line.size();
        ++node_.counts.updates_dropped;
        return true;
    });
    if (!held_.empty()) {
        node_.deadlines.arm(*this, now);
    }
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
        ask(publisher, now);
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
