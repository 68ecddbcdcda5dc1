// SPDX-License-Identifier: BSL-1.0
#include "core/presence.hpp"

#include "core/reachable.hpp"
#include "protocol/message.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {

// -- what is heard -------------------------------------------------------------------------------------------------

void presence::take(run& into, const announcement& said, std::uint64_t seq, time_point now) {
    if (into.said.endpoints != said.endpoints) {
        into.endpoints = reachable_endpoints(said.endpoints, into.from);
    }
    into.said = said;
    into.seq = seq;
    into.heard = now;
}

presence::run presence::first_words(const announcement& said, std::uint32_t epoch, std::uint64_t seq,
                                    const group_source& from, time_point now) {
    run r;
    r.epoch = epoch;
    r.from = from;
    take(r, said, seq, now);
    return r;
}

presence::verdict presence::hear(const announcement& said, std::uint32_t epoch, std::uint64_t seq,
                                 const group_source& from, time_point now) {
    const bool own_name = said.node == own_name_;
    if (own_name && epoch == own_epoch_) {
        return verdict::own;
    }
    if (has_left(epoch, seq)) {
        return verdict::old;
    }
    if (own_name) {
        if (namesake_) { // this node has announced itself since, or will
            namesake_->first_heard_since = true;
        }
        return hear_rival(namesake_, first_words(said, epoch, seq, from, now));
    }
    const auto at = peers_.find(said.node);
    if (at != peers_.end() && at->second.owner.is(epoch, from)) {
        return hear_owner(at, said, seq, now);
    }
    if (at != peers_.end() && !at->second.suspect) {
        return hear_rival(at->second.second, first_words(said, epoch, seq, from, now));
    }
    if (said.leaving) {
        return verdict::old;
    }
    if (at != peers_.end()) {
        remember(at->second.owner);
        succeed(at, first_words(said, epoch, seq, from, now));
        return verdict::taken;
    }
    if (peers_.size() >= most_) {
        return verdict::refused;
    }
    const auto made = peers_.emplace(said.node, entry{first_words(said, epoch, seq, from, now), false, nullptr}).first;
    follow(made->second.owner.silent_at());
    tell(said.node, change::appeared, made->second.owner.where());
    return verdict::taken;
}

presence::verdict presence::hear_owner(entries::iterator at, const announcement& said, std::uint64_t seq,
                                       time_point now) {
    auto& [name, e] = *at;
    if (seq <= e.owner.seq) {
        return verdict::old;
    }
    if (said.leaving) {
        e.owner.seq = seq;
        end(at, change::left, now);
        return verdict::taken;
    }
    const std::string before{e.owner.where()};
    take(e.owner, said, seq, now);
    if (e.second) {
        e.second->first_heard_since = true;
    }
    follow(e.owner.silent_at());
    const bool returned = std::exchange(e.suspect, false);
    if (before != e.owner.where()) {
        tell(name, change::moved, e.owner.where());
    } else if (returned) {
        tell(name, change::returned, e.owner.where());
    }
    return verdict::taken;
}

presence::verdict presence::hear_rival(std::unique_ptr<rival>& second, run said) {
    if (second && second->of.is(said.epoch, said.from)) {
        if (said.seq <= second->of.seq) {
            return verdict::old;
        }
        if (said.said.leaving) {
            remember(said);
            second.reset();
            return verdict::taken;
        }
        second->of = std::move(said);
        follow(second->of.silent_at());
        // One word of it alone may be late, from a run that is over.
        if (second->first_heard_since && !second->clashes) {
            second->clashes = true;
            const auto name = second->of.said.node;
            tell(name, change::clash, host_text(second->of.from));
        }
        return verdict::taken;
    }
    if (said.said.leaving || (second && second->of.silent_at() > said.heard)) {
        return verdict::old; // there is room for two of a name
    }
    second = std::make_unique<rival>(rival{std::move(said), false, false});
    follow(second->of.silent_at());
    return verdict::taken;
}

// -- what ends -----------------------------------------------------------------------------------------------------

// The owner of a name is no more. Who waits for the name has it.
void presence::end(entries::iterator at, change how, time_point now) {
    remember(at->second.owner);
    auto next = std::move(at->second.second);
    if (next && next->of.silent_at() > now) {
        succeed(at, std::move(next->of));
        return;
    }
    const auto name = at->first;
    peers_.erase(at);
    tell(name, how, {});
}

void presence::succeed(entries::iterator at, run next) {
    at->second = entry{std::move(next), false, nullptr};
    follow(at->second.owner.silent_at());
    const auto name = at->first;
    tell(name, change::moved, at->second.owner.where());
}

bool presence::has_left(std::uint32_t epoch, std::uint64_t seq) const noexcept {
    return std::any_of(farewells_.begin(), farewells_.end(),
                       [&](const farewell& f) { return f.epoch == epoch && seq <= f.seq; });
}

void presence::remember(const run& left) noexcept {
    farewells_[next_farewell_++ % farewells_.size()] = {left.epoch, left.seq};
}

// -- time ----------------------------------------------------------------------------------------------------------

void presence::follow(time_point due) {
    if (!armed() || due < this->due()) {
        deadlines_.arm(*this, due);
    }
}

// Looks at all, and sets itself for whichever is next: that costs less than to be set anew by each announcement.
void presence::on_deadline(time_point now) {
    for (auto at = peers_.begin(); at != peers_.end();) {
        const auto here = at++;
        auto& e = here->second;
        if (e.second && e.second->of.silent_at() <= now) {
            e.second.reset();
        }
        if (now >= e.owner.gone_at() || (e.second && now >= e.owner.silent_at())) {
            end(here, change::gone, now);
        } else if (!e.suspect && now >= e.owner.silent_at()) {
            e.suspect = true;
            tell(here->first, change::silent, e.owner.where());
        }
    }
    if (namesake_ && namesake_->of.silent_at() <= now) {
        namesake_.reset();
    }
    for (const auto& [name, e] : peers_) {
        follow(e.suspect ? e.owner.gone_at() : e.owner.silent_at());
        if (e.second) {
            follow(e.second->of.silent_at());
        }
    }
    if (namesake_) {
        follow(namesake_->of.silent_at());
    }
}

void presence::tell(std::string_view node, change what, std::string_view where) const {
    if (watcher_ != nullptr) {
        watcher_->on_peer(node, what, where);
    }
}

// -- what is known -------------------------------------------------------------------------------------------------

std::optional<std::string_view> presence::find(std::string_view node) const noexcept {
    const auto at = peers_.find(node);
    return at == peers_.end() ? std::nullopt : std::optional{at->second.owner.where()};
}

std::vector<peer> presence::list(time_point now) const {
    std::vector<peer> all;
    const auto add = [&](const run& r, peer_state state) {
        all.push_back({.node = r.said.node,
                       .endpoints = r.endpoints,
                       .epoch = protocol::epoch_text(r.epoch),
                       .age = std::chrono::duration_cast<std::chrono::milliseconds>(now - r.heard),
                       .state = state,
                       .load = r.said.load,
                       .tasks = r.said.tasks});
    };
    const auto add_rival = [&](const std::unique_ptr<rival>& second) {
        if (second && second->clashes) {
            add(second->of, peer_state::clash);
        }
    };
    bool namesake_due = true;
    for (const auto& [name, e] : peers_) {
        if (namesake_due && own_name_ < name) {
            namesake_due = false;
            add_rival(namesake_);
        }
        add(e.owner, e.suspect ? peer_state::suspect : peer_state::live);
        add_rival(e.second);
    }
    if (namesake_due) {
        add_rival(namesake_);
    }
    return all;
}

void write_peers(json_writer& w, const presence& others, time_point now) {
    w.begin_object();
    w.plain_key("peers");
    w.begin_array();
    for (const auto& p : others.list(now)) {
        w.begin_object();
        w.plain_key("node");
        w.value(std::string_view{p.node});
        w.plain_key("endpoints");
        w.begin_array();
        for (const auto& endpoint : p.endpoints) {
            w.value(std::string_view{endpoint});
        }
        w.end_array();
        w.plain_key("epoch");
        w.value(std::string_view{p.epoch});
        w.plain_key("age_ms");
        w.value(std::int64_t{p.age.count()});
        w.plain_key("state");
        w.value(to_string(p.state));
        w.plain_key("load");
        write_load(w, p.load);
        w.end_object();
    }
    w.end_array();
    w.end_object();
}

} // namespace cles::core
