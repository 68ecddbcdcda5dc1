// SPDX-License-Identifier: BSL-1.0
#include "federation/published_nouns.hpp"

#include "federation/carried_line.hpp"
#include "protocol/reply_line.hpp"

#include <algorithm>
#include <set>
#include <utility>

namespace cles::bridging {
namespace {

constexpr std::uint32_t upstream_keep = 1024;

std::string from_adverb(std::string_view requester) {
    return requester.empty() ? std::string{} : std::string{" from="}.append(requester);
}

} // namespace

void published_nouns::bind(const protocol::request_line& request, subscriber who) {
    const key which{noun_of(request), who.requester};
    const auto found = nouns_.find(which.first);
    if (found != nouns_.end() && found->second.parts.size() >= max_requesters &&
        !found->second.parts.contains(which.second)) {
        nats_.refuse(who.reply, {.code = errc::busy,
                                 .message = "'" + which.first + "' is bound for " + std::to_string(max_requesters) +
                                            " members of other pools already",
                                 .retry_ms = protocol::default_retry_ms});
        return;
    }
    ++nats_.counts().requests_taken;
    nats_.acknowledge(who.reply);
    auto& p = nouns_[which.first].parts[which.second];
    const auto from = who.by.pool;
    p.waiting.push_back(std::move(who));
    if (p.asked == 0) { // else the reply to an earlier one will do
        p.asked = ++last_id_;
        auto line = "BIND " + which.first + " id=" + std::to_string(p.asked) +
                    " deadline=" + std::to_string(request.deadline_ms) + " keep=" + std::to_string(upstream_keep) +
                    " mark=yes hops=" + std::to_string(request.hops) + from_adverb(which.second);
        line.append(" via=").append(via_of(request, from));
        out_.deliver(link_of(which.second), std::move(line)); // which may call `on_closed`
    }
}

void published_nouns::on_line(const bridge_link& from, std::string_view line) {
    if (line.starts_with("UPDATE ")) {
        publish_update(line);
    } else if (const auto parts = split_reply(line); parts.id != 0) {
        on_reply(from, parts.id, parts.rest);
    }
}

void published_nouns::on_reply(const bridge_link& from, std::uint64_t id, std::string_view reply) {
    const auto is_answered = [&](const auto& each) {
        const auto at = each.second.parts.find(from.member);
        return at != each.second.parts.end() && at->second.asked == id;
    };
    const auto found = std::ranges::find_if(nouns_, is_answered);
    if (found == nouns_.end()) {
        return;
    }
    const key which{found->first, from.member};
    auto& p = found->second.parts.find(from.member)->second;
    p.asked = 0;
    const auto taken = taken_text(nats_.self().instance) + " ";
    const bool is_failure = protocol::is_failure(reply);
    for (auto& who : std::exchange(p.waiting, {})) {
        if (!nats_.answer(who.reply, reply, taken)) {
            if (is_failure) {
                nats_.refuse(who.reply, {.code = errc::failed, .message = "the node's reason is too long for NATS"});
            } else {
                nats_.publish_short(who.reply, taken + "{}"); // it is bound nevertheless, without a value
            }
        }
        if (is_failure) {
            continue;
        }
        auto& binds = p.bound[who.by];
        binds.push_back(std::move(who.reply));
        if (binds.size() > max_binds) {
            binds.pop_front(); // the other bridge keeps the last ones, too
        }
    }
    if (p.bound.empty() && is_failure) {
        forget(which);
        end_if_unknown(from);
    } else {
        end_if_unused(which); // all may have left meanwhile
    }
}

void published_nouns::publish_update(std::string_view line) {
    protocol::request_line update;
    protocol::malformed_request ignored;
    if (!protocol::parse_request(line, update, ignored) || !update.is_update()) {
        return; // the node itself writes these lines
    }
    const auto found = nouns_.find(noun_of(update));
    if (found == nouns_.end() || !found->second.published.add(*update.epoch, *update.seq)) {
        return; // nobody is bound any more, or it came for another requester before
    }
    constexpr std::string_view verb_text = "UPDATE ";
    const auto& noun = update.noun;
    auto message = std::string{line.substr(verb_text.size() + noun.target.size() + 1 + noun.task.size())};
    const bool is_sent =
        nats_.fits(message) && nats_.publish(feed_subject(nats_.pool(), noun.target, noun.task), std::move(message));
    ++(is_sent ? nats_.counts().updates_sent : nats_.counts().updates_dropped); // shows as a gap
}

published_nouns::part* published_nouns::find(const key& which) {
    const auto found = nouns_.find(which.first);
    if (found == nouns_.end()) {
        return nullptr;
    }
    const auto at = found->second.parts.find(which.second);
    return at == found->second.parts.end() ? nullptr : &at->second;
}

std::vector<published_nouns::key> published_nouns::all() const {
    std::vector<key> found;
    for (const auto& [noun, n] : nouns_) {
        for (const auto& [requester, p] : n.parts) {
            found.emplace_back(noun, requester);
        }
    }
    return found;
}

void published_nouns::unbind(const std::string& noun, const bridge_id& by) {
    const auto found = nouns_.find(noun);
    if (found == nouns_.end()) {
        return;
    }
    std::vector<key> of_noun; // copies, since what follows may erase any
    for (const auto& [requester, p] : found->second.parts) {
        of_noun.emplace_back(noun, requester);
    }
    for (const auto& which : of_noun) {
        unbind(which, by);
    }
}

void published_nouns::unbind(const key& which, const bridge_id& by) {
    if (auto* const p = find(which)) {
        p->bound.erase(by);
        std::erase_if(p->waiting, [&by](const subscriber& s) { return s.by == by; });
        end_if_unused(which);
    }
}

void published_nouns::cancel(const bridge_id& by, std::string_view reply) {
    for (auto& [noun, n] : nouns_) {
        for (auto& [requester, p] : n.parts) {
            const auto bound = p.bound.find(by);
            const bool was_bound = bound != p.bound.end() && std::erase(bound->second, reply) != 0;
            if (was_bound && bound->second.empty()) {
                unbind(key{noun, requester}, by); // which may erase both
                return;
            }
            const auto is_it = [&](const subscriber& s) { return s.by == by && s.reply == reply; };
            if (was_bound || std::erase_if(p.waiting, is_it) != 0) { // `on_reply` sees whether somebody is left
                return;
            }
        }
    }
}

void published_nouns::on_lost(const bridge_id& by) {
    for (const auto& which : all()) {
        unbind(which, by);
    }
}

void published_nouns::on_closed(const bridge_link& which) {
    if (which.member.empty()) { // all of them, as bridges of earlier versions expect it
        lose_all();
        return;
    }
    for (const auto& each : all()) {
        if (each.second != which.member) {
            continue;
        }
        const auto gone = std::move(*find(each));
        forget(each);
        for (const auto& who : gone.waiting) {
            nats_.refuse(who.reply, {.code = errc::unavailable, .message = "the node has closed the link"});
        }
        for (const auto& [by, binds] : gone.bound) {
            for (const auto& reply : binds) {
                nats_.send_control(by, unbound_line(parse_subject(reply).number));
            }
        }
    }
}

void published_nouns::lose_all() {
    std::set<bridge_id> concerned;
    for (const auto& [noun, n] : std::exchange(nouns_, {})) {
        for (const auto& [requester, p] : n.parts) {
            for (const auto& [by, binds] : p.bound) {
                concerned.insert(by);
            }
            for (const auto& who : p.waiting) {
                concerned.insert(who.by);
            }
        }
    }
    for (const auto& each : concerned) {
        nats_.send_control(each, std::string{lost_line});
    }
}

// Ends the binding at the node if nobody needs it. While one is being asked for, `on_reply` sees to that.
void published_nouns::end_if_unused(const key& which) {
    const auto* const p = find(which);
    if (p == nullptr || !p->bound.empty() || p->asked != 0) {
        return;
    }
    forget(which);
    const auto& [noun, requester] = which;
    const auto link = link_of(requester);
    out_.deliver(link, "BIND " + noun + " id=" + std::to_string(++last_id_) + " lease=0" + from_adverb(requester));
    end_if_unknown(link);
}

// The link of a requester for whom nothing is bound any more.
void published_nouns::end_if_unknown(const bridge_link& link) {
    if (!link.member.empty() && !is_requester_known(link.member)) {
        out_.end(link);
    }
}

bool published_nouns::is_requester_known(std::string_view requester) const {
    return std::ranges::any_of(nouns_, [requester](const auto& each) { return each.second.parts.contains(requester); });
}

void published_nouns::forget(const key& which) {
    if (const auto found = nouns_.find(which.first); found != nouns_.end()) {
        found->second.parts.erase(which.second);
        if (found->second.parts.empty()) {
            nouns_.erase(found);
        }
    }
}

} // namespace cles::bridging
