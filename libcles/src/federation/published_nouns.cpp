// SPDX-License-Identifier: BSL-1.0
#include "federation/published_nouns.hpp"

#include "federation/carried_line.hpp"
#include "protocol/reply_line.hpp"

#include <algorithm>
#include <utility>

namespace cles::bridging {
namespace {

constexpr std::uint32_t upstream_keep = 1024;

} // namespace

void published_nouns::bind(const protocol::request_line& request, subscriber who) {
    ++nats_.counts().requests_taken;
    nats_.acknowledge(who.reply);
    const auto noun = noun_of(request);
    auto& n = nouns_[noun];
    const auto from = who.by.pool;
    n.waiting.push_back(std::move(who));
    if (n.asked == 0) { // else the reply to an earlier one will do
        n.asked = ++last_id_;
        auto line = "BIND " + noun + " id=" + std::to_string(n.asked) +
                    " deadline=" + std::to_string(request.deadline_ms) + " keep=" + std::to_string(upstream_keep) +
                    " mark=yes hops=" + std::to_string(request.hops);
        line.append(" via=").append(via_of(request, from));
        deliver(std::move(line));
    }
}

void published_nouns::on_line(std::string_view line) {
    if (line.starts_with("UPDATE ")) {
        publish_update(line);
    } else if (const auto parts = split_reply(line); parts.id != 0) {
        on_reply(parts.id, parts.rest);
    }
}

void published_nouns::on_reply(std::uint64_t id, std::string_view reply) {
    const auto found = std::ranges::find_if(nouns_, [id](const auto& each) { return each.second.asked == id; });
    if (found == nouns_.end()) {
        return;
    }
    auto& n = found->second;
    n.asked = 0;
    const auto taken = taken_text(nats_.self().instance) + " ";
    const bool is_failure = protocol::is_failure(reply);
    for (auto& who : std::exchange(n.waiting, {})) {
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
        if (auto& binds = n.bound[who.by]; binds.size() < max_binds) {
            binds.insert(std::move(who.reply));
        }
    }
    if (n.bound.empty() && is_failure) {
        nouns_.erase(found);
    } else if (n.bound.empty()) { // all have left meanwhile
        end(found);
    }
}

void published_nouns::publish_update(std::string_view line) {
    constexpr std::string_view verb_text = "UPDATE ";
    const auto text = line.substr(verb_text.size());
    const auto noun = text.substr(0, text.find(' '));
    const auto colon = noun.find(':');
    if (colon == std::string_view::npos) {
        return;
    }
    const auto path = noun.substr(colon + 1);
    const auto task = path.substr(0, path.find('/'));
    auto message = std::string{text.substr(colon + 1 + task.size())};
    const bool is_sent = nats_.fits(message) &&
                         nats_.publish(feed_subject(nats_.pool(), noun.substr(0, colon), task), std::move(message));
    ++(is_sent ? nats_.counts().updates_sent : nats_.counts().updates_dropped); // shows as a gap
}

void published_nouns::unbind(const std::string& noun, const bridge_id& by) {
    const auto found = nouns_.find(noun);
    if (found == nouns_.end()) {
        return;
    }
    auto& n = found->second;
    n.bound.erase(by);
    std::erase_if(n.waiting, [&by](const subscriber& s) { return s.by == by; });
    if (n.bound.empty() && n.asked == 0) { // else `on_reply` sees whether somebody is left
        end(found);
    }
}

void published_nouns::cancel(const subscriber& who) {
    for (auto& [noun, n] : nouns_) {
        const auto bound = n.bound.find(who.by);
        const bool was_bound = bound != n.bound.end() && bound->second.erase(who.reply) != 0;
        if (was_bound && bound->second.empty()) {
            unbind(std::string{noun}, who.by); // which may erase it
        }
        if (was_bound || std::erase(n.waiting, who) != 0) { // `on_reply` sees whether somebody is left
            return;
        }
    }
}

void published_nouns::on_lost(const bridge_id& by) {
    std::vector<std::string> all;
    for (const auto& [noun, n] : nouns_) {
        all.push_back(noun);
    }
    for (const auto& noun : all) {
        unbind(noun, by);
    }
}

void published_nouns::on_closed() {
    std::set<bridge_id> all;
    for (const auto& [noun, n] : std::exchange(nouns_, {})) {
        for (const auto& [by, binds] : n.bound) {
            all.insert(by);
        }
        for (const auto& who : n.waiting) {
            all.insert(who.by);
        }
    }
    for (const auto& each : all) {
        nats_.send_control(each, std::string{lost_line});
    }
}

// Nobody is bound any more.
void published_nouns::end(entries::iterator which) {
    const auto gone = nouns_.extract(which);
    deliver("BIND " + gone.key() + " id=" + std::to_string(++last_id_) + " lease=0");
}

void published_nouns::deliver(std::string line) {
    out_.deliver({bridge_link::role::publications, {}}, std::move(line));
}

} // namespace cles::bridging
