// SPDX-License-Identifier: BSL-1.0
#include "core/presence.hpp"

#include "core/announcer.hpp"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

namespace cles::core {

// -- what is heard -------------------------------------------------------------------------------------------------

presence::verdict presence::hear(const announcement& said, std::uint32_t epoch, std::uint64_t seq,
                                 const group_source& from, time_point now) {
    return take_word({said, epoch, seq, now, from, teller::of(from)}, now);
}

presence::verdict presence::be_told(const peer_report& report, const teller& by, time_point asked, time_point now) {
    const word w{report.said, report.epoch, report.seq, asked - report.age, {}, by};
    return report.said.leaving ? take_farewell(w, now) : take_word(w, now);
}

presence::verdict presence::be_told(const peer_beat& beat, time_point asked, time_point now) {
    const auto spoken = asked - beat.age;
    const auto second_says = [&](const known_run& r, auto&& take) {
        auto said = r.said;
        said.interval = beat.interval;
        said.load.queued = beat.queued;
        said.load.running = beat.running;
        return take(word{said, beat.epoch, beat.seq, spoken, {}, {}});
    };
    if (beat.epoch == own_epoch_) {
        return verdict::own;
    }
    if (namesake_ && namesake_->of.epoch == beat.epoch) {
        return second_says(namesake_->of, [&](const word& w) { return take_namesakes_word(w, now); });
    }
    auto* const at = by_epoch_.find(beat.epoch);
    if (at == nullptr) {
        return ended_.covers(beat.epoch, beat.seq) ? verdict::old : verdict::unknown;
    }
    auto& e = at->second;
    if (e.owner.epoch != beat.epoch) {
        const auto result =
            second_says(e.second->of, [&](const word& w) { return take_rivals_word(e.second, w, now); });
        if (result == verdict::taken) {
            freshen(*at);
        }
        return result;
    }
    if (!e.owner.is_older_than(beat.seq, spoken)) {
        return verdict::old;
    }
    auto& r = e.owner;
    r.seq = std::max(r.seq, beat.seq);
    r.heard = std::max(r.heard, spoken);
    r.said.interval = beat.interval;
    r.said.load.queued = beat.queued;
    r.said.load.running = beat.running;
    r.news = ++news_;
    heard_again(*at, false, true, now);
    return verdict::taken;
}

void presence::speak(const announcement& own, std::uint64_t seq, time_point now) {
    if (!own_) {
        own_since_ = now;
        own_.emplace();
        own_->epoch = own_epoch_;
        own_->described = ++news_;
    }
    auto& r = *own_;
    if (r.said.endpoints != own.endpoints || r.said.tasks != own.tasks || r.is_another_choice(own.load)) {
        r.described = ++news_;
        r.service_us = own.load.service_us;
    }
    r.said = own;
    r.passed_on = own.endpoints;
    r.seq = seq;
    r.heard = now;
    r.news = ++news_;
}

void presence::leave(time_point now) {
    if (!own_ || own_->said.leaving) {
        return;
    }
    own_->said.leaving = true;
    ++own_->seq;
    own_->heard = now;
    own_->news = ++news_;
}

known_run presence::first_words(const word& w) {
    ended_.forget(w.epoch);
    return known_run::first(w, news_);
}

presence::verdict presence::take_word(const word& w, time_point now) {
    if (w.said.pool != own_pool_) {
        return verdict::foreign;
    }
    const bool own_name = w.said.node == own_name_;
    if (own_name && w.epoch == own_epoch_) {
        return verdict::own;
    }
    if (ended_.covers(w.said.node, w.epoch, w.seq)) {
        return verdict::old;
    }
    if (own_name) {
        return take_namesakes_word(w, now);
    }
    const auto at = peers_.find(w.said.node);
    if (at != peers_.end() && at->second.owner.is(w.epoch, w.from)) {
        return take_owners_word(at, w, now);
    }
    if (at != peers_.end() && !at->second.suspect) {
        auto& second = at->second.second;
        if (second) {
            by_epoch_.remove(second->of.epoch, &*at);
        }
        const auto result = take_rivals_word(second, w, now);
        if (second) {
            by_epoch_.add(second->of.epoch, &*at);
        }
        if (second && result == verdict::taken) {
            freshen(*at);
            check_owner(at->first, now);
        }
        return result;
    }
    if (w.said.leaving) {
        return verdict::old;
    }
    if (at != peers_.end()) {
        if (w.told() && w.spoken <= at->second.owner.heard) {
            return verdict::old;
        }
        remember(at->first, at->second.owner, false, now);
        succeed(at, first_words(w));
        return verdict::taken;
    }
    if (is_stale(w, now)) {
        return verdict::old;
    }
    if (peers_.size() >= most_) {
        return verdict::refused;
    }
    const auto made = peers_.emplace(w.said.node, entry{first_words(w), false, nullptr, {}, now}).first;
    made->second.in_news = by_news_.insert(by_news_.end(), &*made);
    by_epoch_.add(w.epoch, &*made);
    follow(silent_at(made->second.owner));
    tell(w.said.node, change::appeared, made->second.owner.where());
    return verdict::taken;
}

presence::verdict presence::take_owners_word(entries::iterator at, const word& w, time_point now) {
    auto& r = at->second.owner;
    if (!r.is_older_than(w.seq, w.spoken)) {
        const auto result = r.is_repeated_by(w) ? verdict::again : verdict::old;
        if (r.hear_again(w)) {
            r.described = r.news = ++news_;
            freshen(*at);
            tell(at->first, change::moved, r.where());
        }
        return result;
    }
    if (w.said.leaving) {
        r.seq = w.seq;
        end(at, change::left, now);
        return verdict::taken;
    }
    const std::string before{r.where()};
    r.take(w, news_);
    heard_again(*at, before != r.where(), w.told(), now);
    return verdict::taken;
}

void presence::heard_again(named_entry& one, bool moved, bool told, time_point now) {
    auto& [name, e] = one;
    freshen(one);
    if (e.second) {
        // What is told comes late: a word of the owner from before the other one began says nothing against that one.
        e.second->first_heard_since |=
            !told || e.owner.heard > e.second->first + interval_of(e.owner.said, e.owner.from);
    }
    follow(silent_at(e.owner));
    // The last word of one that is silent may come late too.
    const bool returned = e.suspect && silent_at(e.owner) > now;
    e.suspect = e.suspect && !returned;
    if (moved) {
        tell(name, change::moved, e.owner.where());
    } else if (returned) {
        tell(name, change::returned, e.owner.where());
    } else {
        say_heard(name);
    }
}

presence::verdict presence::take_namesakes_word(const word& w, time_point now) {
    if (namesake_) { // this node has announced itself since, or will; but what is told may be of its former run
        namesake_->first_heard_since |= !w.told() || (own_ && w.spoken > own_since_ + interval_of(w.said, w.from));
    }
    const auto result = take_rivals_word(namesake_, w, now);
    check_namesake(now);
    return result;
}

presence::verdict presence::take_rivals_word(std::unique_ptr<rival>& second, const word& w, time_point now) {
    if (second && second->of.is(w.epoch, w.from)) {
        if (!second->of.is_older_than(w.seq, w.spoken)) {
            const auto result = second->of.is_repeated_by(w) ? verdict::again : verdict::old;
            second->of.hear_again(w);
            return result;
        }
        if (w.said.leaving) {
            second->of.seq = w.seq;
            remember(w.said.node, second->of, true, now);
            second.reset();
            return verdict::taken;
        }
        second->of.take(w, news_);
        follow(silent_at(second->of));
        // One word of it alone may be late, from a run that is over.
        if (second->first_heard_since && !second->clashes) {
            second->clashes = true;
            const auto& r = second->of;
            const auto name = r.said.node;
            tell(name, change::clash, r.from == group_source{} ? std::string{r.where()} : host_text(r.from));
        }
        return verdict::taken;
    }
    if (w.said.leaving || (second && silent_at(second->of) > now) || is_stale(w, now)) {
        return verdict::old; // there is room for two of a name
    }
    second = std::make_unique<rival>(rival{first_words(w), w.spoken, false, false, {}});
    follow(silent_at(second->of));
    return verdict::taken;
}

// -- what ends -----------------------------------------------------------------------------------------------------

presence::verdict presence::take_farewell(const word& w, time_point now) {
    if (w.said.node == own_name_ && w.epoch == own_epoch_) {
        return verdict::own;
    }
    const auto until = w.spoken + interval_of(w.said, w.from) * 15;
    if (ended_.covers(w.said.node, w.epoch, w.seq) || until <= now) {
        return verdict::old;
    }
    const auto at = peers_.find(w.said.node);
    if (at != peers_.end() && at->second.owner.epoch == w.epoch) {
        auto& r = at->second.owner;
        if (r.from != group_source{} || w.seq < r.seq) { // it would have said so in the group
            return verdict::old;
        }
        r.seq = w.seq;
        end(at, change::left, now);
        return verdict::taken;
    }
    if (at != peers_.end() && at->second.second && at->second.second->of.epoch == w.epoch) {
        drop_second(at);
    }
    ended_.add(w.epoch, {w.said.node, w.seq, w.spoken, until, true, ++news_}, now);
    return verdict::taken;
}

// The owner of a name is no more. Who waits for the name has it.
void presence::end(entries::iterator at, change how, time_point now) {
    remember(at->first, at->second.owner, how == change::left, now);
    auto& second = at->second.second;
    if (second && silent_at(second->of) > now) {
        succeed(at, std::move(second->of));
        return;
    }
    drop_second(at);
    by_epoch_.remove(at->second.owner.epoch, &*at);
    const auto name = at->first;
    const std::string where{at->second.owner.where()};
    by_news_.erase(at->second.in_news);
    peers_.erase(at);
    tell(name, how, where);
}

void presence::succeed(entries::iterator at, known_run next) {
    by_epoch_.remove(at->second.owner.epoch, &*at);
    if (at->second.second) {
        by_epoch_.remove(at->second.second->of.epoch, &*at);
    }
    by_epoch_.add(next.epoch, &*at);
    next.described = next.news = ++news_;
    const auto since = next.heard;
    at->second = entry{std::move(next), false, nullptr, at->second.in_news, since};
    freshen(*at);
    follow(silent_at(at->second.owner));
    const auto name = at->first;
    tell(name, change::moved, at->second.owner.where());
}

void presence::drop_second(entries::iterator at) {
    if (at->second.second) {
        by_epoch_.remove(at->second.second->of.epoch, &*at);
        at->second.second.reset();
    }
}

void presence::remember(const std::string& node, const known_run& over, bool farewell, time_point now) {
    if (over.seq != 0 || farewell) { // without numbers nothing that it said could be told from what it will say
        ended_.add(
            over.epoch,
            {node, over.seq, now, now + interval_of(over.said, over.from) * 15, farewell, farewell ? ++news_ : 0}, now);
    }
}

// -- time ----------------------------------------------------------------------------------------------------------

// Of one that has just started, and knows few, it is told how soon it will speak again, and not how long that takes to
// get here.
std::chrono::milliseconds presence::interval_of(const announcement& said, const group_source& from) const {
    return from == group_source{} ? std::max(said.interval, announcer::interval_among(peers_.size())) : said.interval;
}

bool presence::is_stale(const word& w, time_point now) const {
    return w.told() && now - w.spoken >= interval_of(w.said, w.from) * 7 / 2;
}

time_point presence::silent_at(const known_run& r) const {
    return std::max(r.heard, excused_) + interval_of(r.said, r.from) * 7 / 2;
}

time_point presence::gone_at(const known_run& r) const {
    return std::max(r.heard, excused_) + interval_of(r.said, r.from) * 15;
}

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
        if (e.second && silent_at(e.second->of) <= now) {
            drop_second(here);
        }
        if (now >= gone_at(e.owner) || (e.second && now >= silent_at(e.owner))) {
            end(here, change::gone, now);
        } else if (!e.suspect && now >= silent_at(e.owner)) {
            e.suspect = true;
            tell(here->first, change::silent, e.owner.where());
        }
    }
    if (namesake_ && silent_at(namesake_->of) <= now) {
        namesake_.reset();
    }
    for (const auto& [name, e] : peers_) {
        follow(e.suspect ? gone_at(e.owner) : silent_at(e.owner));
        if (e.second) {
            follow(silent_at(e.second->of));
        }
    }
    if (namesake_) {
        follow(silent_at(namesake_->of));
    }
}

void presence::tell(std::string_view node, change what, std::string_view where) const {
    if (watcher_ != nullptr) {
        watcher_->on_peer(node, what, where);
    }
    say_heard(node);
}

void presence::say_heard(std::string_view node) const {
    if (observer_ != nullptr) {
        observer_->on_heard(node);
    }
}

} // namespace cles::core
