// SPDX-License-Identifier: BSL-1.0
#include "node/membership/membership.hpp"

#include <cles/peer.hpp>

#include "node/membership/reachable_endpoints.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>

namespace cles::core {
namespace {

/// An endpoint of the sighting at the address from which it was sent; empty if it has none.
std::string endpoint_at_source(const sighting& w) {
    for (auto& url : reachable_endpoints(w.announced.endpoints, w.by)) {
        if (observed_source::at(url).host == w.by.host) {
            return std::move(url);
        }
    }
    return {};
}

} // namespace

// -- sightings -----------------------------------------------------------------------------------------------------

membership::verdict membership::apply_announcement(const announcement& said, std::uint32_t epoch, std::uint64_t seq,
                                                   const group_source& from, time_point now, bool again) {
    return take_sighting({said, epoch, seq, now, from, observed_source::of(from), again}, now);
}

const incarnation* membership::find_run(std::string_view node, std::uint32_t epoch) const noexcept {
    const auto at = peers_.find(node);
    if (at != peers_.end() && at->second.owner.epoch == epoch) {
        return &at->second.owner;
    }
    const auto* const second = node == own_name_    ? own_name_conflict_.get()
                               : at == peers_.end() ? nullptr
                                                    : at->second.second.get();
    return second != nullptr && second->contender.epoch == epoch ? &second->contender : nullptr;
}

bool membership::is_elsewhere(std::string_view node, std::uint32_t epoch, const group_source& from) const noexcept {
    const auto* const run = find_run(node, epoch);
    return run != nullptr && !run->may_send_from(from);
}

// A hint: members can send unsigned updates under another name. So it moves nothing, and makes no conflict.
membership::verdict membership::apply_load(std::string_view node, std::uint32_t epoch, std::uint64_t seq,
                                           const node_load& load, const group_source& from, time_point now) {
    if (node == own_name_ && epoch == own_epoch_) {
        return verdict::own;
    }
    const auto at = peers_.find(node);
    const auto applies_to = [&](const incarnation& r) {
        return r.announced.original && r.epoch == epoch && r.may_send_from(from);
    };
    auto* const second = node == own_name_    ? own_name_conflict_.get()
                         : at == peers_.end() ? nullptr
                                              : at->second.second.get();
    if (second != nullptr && applies_to(second->contender) && seq >= second->contender.seq) {
        second->contender.on_hint(now, revision_);
        follow(suspect_at(second->contender));
        return verdict::taken;
    }
    if (at == peers_.end() || !applies_to(at->second.owner)) {
        return verdict::unknown;
    }
    auto& r = at->second.owner;
    if (seq < r.seq) {
        return verdict::old;
    }
    r.on_hint(now, revision_);
    if (r.from == from) {
        r.last_seen_at_source = now;
    }
    r.announced.load = load;
    on_owner_seen(*at, false, true, now);
    return verdict::taken;
}

membership::verdict membership::apply_gossip(const peer_report& report, const observed_source& by, time_point asked,
                                             time_point now) {
    const sighting w{report.announced, report.epoch, report.seq, asked - report.age, {}, by};
    return report.announced.leaving ? take_leave(w, now) : take_sighting(w, now);
}

membership::verdict membership::apply_gossip(const peer_heartbeat& beat, time_point asked, time_point now) {
    const auto announced_at = asked - beat.age;
    const auto with_contender = [&](const incarnation& r, auto&& take) {
        auto said = r.announced;
        said.interval = beat.interval;
        said.load.queued = beat.queued;
        said.load.running = beat.running;
        // The announcement itself is not newer if it is signed.
        const auto seq = said.original ? r.seq : beat.seq;
        return take(sighting{said, beat.epoch, seq, announced_at, {}, {}});
    };
    if (beat.epoch == own_epoch_) {
        return verdict::own;
    }
    if (own_name_conflict_ && own_name_conflict_->contender.epoch == beat.epoch) {
        return with_contender(own_name_conflict_->contender,
                              [&](const sighting& w) { return take_own_name_sighting(w, now); });
    }
    auto* const at = by_epoch_.find(beat.epoch);
    if (at == nullptr) {
        return ended_.covers_heartbeat(beat.epoch, beat.seq, announced_at) ? verdict::old : verdict::unknown;
    }
    auto& e = at->second;
    if (e.owner.epoch != beat.epoch) {
        const auto result = with_contender(
            e.second->contender, [&](const sighting& w) { return take_conflicting_sighting(e.second, w, now); });
        if (result == verdict::taken) {
            freshen(*at);
        }
        return result;
    }
    auto& r = e.owner;
    if (r.announced.original ? !is_hinted_alive(r, announced_at) : !r.is_older_than(beat.seq, announced_at)) {
        return verdict::old;
    }
    if (!r.announced.original) { // otherwise only what is signed counts
        r.seq = std::max(r.seq, beat.seq);
        r.announced.interval = beat.interval;
    }
    r.last_seen = std::max(r.last_seen, announced_at);
    r.announced.load.queued = beat.queued;
    r.announced.load.running = beat.running;
    r.revision = ++revision_;
    on_owner_seen(*at, false, true, now);
    return verdict::taken;
}

bool membership::holds(const peer_report& report) const noexcept {
    const auto found = peers_.find(report.announced.node);
    if (found == peers_.end() || !report.announced.original) {
        return false;
    }
    const auto is_of = [&](const incarnation& r) {
        return r.epoch == report.epoch && r.seq == report.seq && r.announced.original &&
               *r.announced.original == *report.announced.original;
    };
    const auto& e = found->second;
    return is_of(e.owner) || (e.second && is_of(e.second->contender));
}

bool membership::has_news(const announcement& own) const noexcept {
    if (!own_) {
        return true;
    }
    const auto& last = own_->announced;
    return last.endpoints != own.endpoints || last.tasks != own.tasks || last.roster != own.roster ||
           last.leaving != own.leaving || last.signed_tasks != own.signed_tasks || last.links != own.links ||
           own_->is_significant_load_change(own.load);
}

void membership::announce_self(const announcement& own, std::uint64_t seq, time_point now) {
    if (!own_) {
        own_since_ = now;
        own_.emplace();
        own_->epoch = own_epoch_;
        own_->described_revision = ++revision_;
    }
    auto& r = *own_;
    if (has_news(own)) {
        r.described_revision = ++revision_;
        r.service_us = own.load.service_us;
    }
    r.announced = own;
    r.relayed_endpoints = own.endpoints;
    r.seq = seq;
    r.last_seen = now;
    r.revision = ++revision_;
}

void membership::leave(time_point now) {
    if (!own_ || own_->announced.leaving) {
        return;
    }
    own_->announced.leaving = true;
    ++own_->seq;
    own_->last_seen = now;
    own_->revision = ++revision_;
}

incarnation membership::first_sighting(const sighting& w) {
    ended_.forget(w.epoch);
    return incarnation::first(w, revision_);
}

membership::verdict membership::take_sighting(const sighting& w, time_point now) {
    if (w.announced.pool != own_pool_) {
        return verdict::foreign;
    }
    const bool own_name = w.announced.node == own_name_;
    if (own_name && w.epoch == own_epoch_) {
        return verdict::own;
    }
    if (is_of_ended(w)) {
        return verdict::old;
    }
    // It may be the last one, by another interface. Otherwise it shows nothing: anybody may have kept it.
    if (const auto* const run = w.again ? find_run(w.announced.node, w.epoch) : nullptr;
        w.again && (run == nullptr || run->seq != w.seq)) {
        return verdict::old;
    }
    if (own_name) {
        return take_own_name_sighting(w, now);
    }
    const auto at = peers_.find(w.announced.node);
    if (at != peers_.end() && at->second.owner.matches(w)) {
        return take_owner_sighting(at, w, now);
    }
    if (at != peers_.end() && at->second.owner.epoch == w.epoch &&
        (!at->second.suspect || !at->second.owner.is_older_than(w))) {
        return take_sighting_elsewhere(at, w, now);
    }
    if (at != peers_.end() && !at->second.suspect) {
        auto& second = at->second.second;
        if (second) {
            by_epoch_.remove(second->contender.epoch, &*at);
        }
        const auto result = take_conflicting_sighting(second, w, now);
        if (second) {
            by_epoch_.add(second->contender.epoch, &*at);
        }
        if (second && result == verdict::taken) {
            freshen(*at);
            conflicts_.check_owner(at->first, at->second.owner, *second, now);
        }
        return result;
    }
    if (w.announced.leaving) {
        return verdict::old;
    }
    if (at != peers_.end()) {
        if (w.is_from_gossip() && w.announced_at <= at->second.owner.last_seen) {
            return verdict::old;
        }
        remember(at->first, at->second.owner, false, now);
        succeed(at, first_sighting(w));
        return verdict::taken;
    }
    if (is_stale(w, now)) {
        return verdict::old;
    }
    if (peers_.size() >= max_peers_) {
        return verdict::refused;
    }
    const auto made = peers_.emplace(w.announced.node, entry{first_sighting(w), false, nullptr, {}, now}).first;
    made->second.in_revision_order = by_revision_.insert(by_revision_.end(), &*made);
    by_epoch_.add(w.epoch, &*made);
    follow(suspect_at(made->second.owner));
    notify(w.announced.node, change::appeared, made->second.owner.where());
    return verdict::taken;
}

// Whether it was announced before that incarnation ended, or may have been. In the group, each announcement has a `seq`
// of its own, so one that is repeated there does not bring an incarnation back.
bool membership::is_of_ended(const sighting& w) const noexcept {
    return w.is_signed() && w.is_from_gossip() ? ended_.covers_signed(w.announced.node, w.epoch, w.seq, w.announced_at)
                                               : ended_.covers(w.announced.node, w.epoch, w.seq);
}

membership::verdict membership::take_owner_sighting(entries::iterator at, const sighting& w, time_point now) {
    if (w.is_from_gossip() && !w.is_signed()) {
        check_new_address(*at, w, now);
    }
    auto& r = at->second.owner;
    if (!r.is_older_than(w)) {
        if (w.is_from_gossip() && is_hinted_alive(r, w.announced_at)) {
            r.on_hint(w.announced_at, revision_);
            on_owner_seen(*at, r.on_repeat(w), true, now);
            return verdict::taken;
        }
        const auto result = r.is_repeated_by(w) ? verdict::duplicate : verdict::old;
        if (r.on_repeat(w)) {
            r.described_revision = r.revision = ++revision_;
            freshen(*at);
            notify(at->first, change::moved, r.where());
        }
        return result;
    }
    if (w.announced.leaving) {
        r.seq = w.seq;
        r.announced.original = w.announced.original;
        end(at, change::left, now);
        return verdict::taken;
    }
    if (auto& other = at->second.elsewhere; other && std::ranges::find(w.announced.sources, other->contender.from) !=
                                                         w.announced.sources.end()) { // its announcement was late
        other.reset();
    }
    const std::string before{r.where()};
    const bool relinked = w.describes() && r.announced.links != w.announced.links;
    r.apply(w, revision_);
    on_owner_seen(*at, before != r.where(), w.is_from_gossip(), now);
    if (relinked) {
        const auto name = w.announced.node;
        notify(name, change::relinked, address_of(name).value_or(std::string_view{}));
    }
    return verdict::taken;
}

void membership::on_owner_seen(named_entry& one, bool moved, bool by_gossip, time_point now) {
    auto& [name, e] = one;
    freshen(one);
    if (e.second) {
        // Gossip is late: an announcement that the owner made before the contender started does not show that both are
        // live.
        e.second->owner_seen_since |=
            !by_gossip || e.owner.last_seen > e.second->first_seen + interval_of(e.owner.announced, e.owner.from);
    }
    follow(suspect_at(e.owner));
    // The last announcement of a silent node may be late too.
    const bool returned = e.suspect && suspect_at(e.owner) > now;
    e.suspect = e.suspect && !returned;
    if (moved) {
        notify(name, change::moved, e.owner.where());
    } else if (returned) {
        notify(name, change::returned, e.owner.where());
    } else {
        notify_seen(name);
    }
}

// A newer announcement from a new source: the node may have moved, or the address from which it sends may have changed,
// which shows if it answers there. Others can only repeat what has arrived, and usually later: at the address in use,
// that is a copy. At another one, it may be one too, since an unspecified address stands for the source; but if the
// owner does not answer any more where it was, and does so there, it has moved.
membership::verdict membership::take_sighting_elsewhere(entries::iterator at, const sighting& w, time_point now) {
    auto& [name, e] = *at;
    const auto is_in_use = [&known = e.owner.endpoints](const std::string& url) {
        return std::ranges::find(known, url) != known.end();
    };
    const auto there = w.seq > e.owner.seq ? endpoint_at_source(w) : std::string{};
    if (w.announced.leaving || w.seq < e.owner.seq ||
        (there.empty() && std::ranges::all_of(reachable_endpoints(w.announced.endpoints, w.by), is_in_use))) {
        return verdict::copied;
    }
    note_elsewhere(*at, w, now);
    auto& other = *e.elsewhere;
    if (there.empty()) {
        conflicts_.check_owner(name, e.owner, other, now);
    } else if (other.contender.from == w.from) {
        conflicts_.check_new_source(name, other, there, now);
    }
    return verdict::copied;
}

// Its revisions are not reported to others: it gets one of this table when it takes the owner's place.
void membership::note_elsewhere(named_entry& one, const sighting& w, time_point now) {
    auto& other = one.second.elsewhere;
    auto numbers = revision_;
    if (!other || suspect_at(other->contender) <= now) {
        other = std::make_unique<name_conflict>(
            name_conflict{incarnation::first(w, numbers), w.announced_at, false, false, {}});
    } else if (other->contender.sends_from(w.from) && other->contender.is_older_than(w)) {
        other->contender.apply(w, numbers);
    }
}

// By gossip, entries of one node have different addresses, depending on their paths, so another address does not
// replace the known one. But if the owner does not answer there any more, and does so at the other one, it has moved.
void membership::check_new_address(named_entry& one, const sighting& w, time_point now) {
    auto& [name, e] = one;
    const auto is_known = [&known = e.owner.endpoints](const std::string& url) {
        return std::ranges::find(known, url) != known.end();
    };
    if (w.announced.leaving || w.seq < e.owner.seq || e.owner.from != group_source{} || e.owner.endpoints.empty()) {
        return;
    }
    const auto said = reachable_endpoints(w.announced.endpoints, w.by);
    if (!said.empty() && std::ranges::none_of(said, is_known)) {
        note_elsewhere(one, w, now);
        conflicts_.check_owner(name, e.owner, *e.elsewhere, now);
    }
}

membership::verdict membership::take_own_name_sighting(const sighting& w, time_point now) {
    // This node announces as well, which shows that both are live. But gossip may be about its previous incarnation.
    if (own_name_conflict_) {
        own_name_conflict_->owner_seen_since |=
            !w.is_from_gossip() || (own_ && w.announced_at > own_since_ + interval_of(w.announced, w.from));
    }
    const auto result = take_conflicting_sighting(own_name_conflict_, w, now);
    if (own_name_conflict_) {
        conflicts_.check_own_name(own_name_, *own_name_conflict_, now);
    }
    return result;
}

membership::verdict membership::take_conflicting_sighting(std::unique_ptr<name_conflict>& second, const sighting& w,
                                                          time_point now) {
    if (second && second->contender.matches(w)) {
        if (!second->contender.is_older_than(w)) {
            if (w.is_from_gossip() && is_hinted_alive(second->contender, w.announced_at)) {
                second->contender.on_hint(w.announced_at, revision_);
                follow(suspect_at(second->contender));
                return verdict::taken;
            }
            const auto result = second->contender.is_repeated_by(w) ? verdict::duplicate : verdict::old;
            second->contender.on_repeat(w);
            return result;
        }
        if (w.announced.leaving) {
            second->contender.seq = w.seq;
            second->contender.announced.original = w.announced.original;
            remember(w.announced.node, second->contender, true, now);
            second.reset();
            return verdict::taken;
        }
        second->contender.apply(w, revision_);
        follow(suspect_at(second->contender));
        // A single announcement may be a late one, of an incarnation that has ended. Signed ones can be repeated by
        // others: only the probes decide.
        if (second->owner_seen_since && !(w.is_signed() && w.is_from_gossip())) {
            report_conflict(*second);
        }
        return verdict::taken;
    }
    if (w.announced.leaving || (second && suspect_at(second->contender) > now) || is_stale(w, now)) {
        return verdict::old; // at most two incarnations of a name are kept
    }
    second = std::make_unique<name_conflict>(name_conflict{first_sighting(w), w.announced_at, false, false, {}});
    follow(suspect_at(second->contender));
    return verdict::taken;
}

// -- name conflicts ------------------------------------------------------------------------------------------------

void membership::on_probed(std::uint64_t ticket, const probe_outcome& found, time_point now) {
    using action = name_conflicts::action;
    const auto name = conflicts_.take_probe(ticket);
    if (!name) {
        return;
    }
    const bool own = *name == own_name_;
    const auto at = own ? peers_.end() : peers_.find(*name);
    auto* const conflict = own ? own_name_conflict_.get() : at != peers_.end() ? at->second.asked_by(ticket) : nullptr;
    if (conflict == nullptr || conflict->check.ticket != ticket) {
        return;
    }
    // For this node's own name, the start times alone decide, and a probe is not repeated.
    const auto owner = own ? name_conflicts::known_owner{*name, own_epoch_, time_point::max(), time_point::min()}
                           : name_conflicts::known_owner{*name, at->second.owner.epoch, at->second.since, resumed_at_};
    switch (conflicts_.on_probed(owner, *conflict, found, now)) {
    case action::none: break;
    case action::owner_gone:
        if (suspect_at(conflict->contender) <= now) {
            break;
        }
        end(at, change::gone, now);
        break;
    case action::owner_moved:
        if (suspect_at(conflict->contender) > now) {
            succeed(at, std::move(conflict->contender));
        }
        break;
    case action::owner_stays: report_conflict(*conflict); break;
    case action::contender_first:
        if (own) {
            const std::string where{conflict->contender.where()};
            report_conflict(*conflict);
            notify(own_name_, change::taken, where);
        } else {
            swap_with_contender(at);
        }
    }
}

void membership::swap_with_contender(entries::iterator at) {
    auto& e = at->second;
    std::swap(e.owner, e.second->contender);
    e.elsewhere.reset();
    e.since = e.second->first_seen;
    e.owner.described_revision = e.owner.revision = ++revision_;
    freshen(*at);
    const auto name = at->first;
    follow(suspect_at(e.owner));
    notify(name, change::moved, e.owner.where());
    const auto still = peers_.find(name);
    if (still != peers_.end() && still->second.second) {
        report_conflict(*still->second.second);
    }
}

void membership::report_conflict(name_conflict& conflict) {
    if (!std::exchange(conflict.is_reported, true)) {
        const auto& r = conflict.contender;
        const auto name = r.announced.node;
        notify(name, change::clash, r.from == group_source{} ? std::string{r.where()} : host_text(r.from));
    }
}

std::string membership::second_of(std::string_view node) const {
    const auto found = peers_.find(node);
    const auto* const second = found == peers_.end() ? nullptr : found->second.second.get();
    if (second == nullptr || !second->is_reported) {
        return {};
    }
    const auto& r = second->contender;
    return r.where().empty() ? host_text(r.from) : std::string{r.where()};
}

// -- leaving and removal -------------------------------------------------------------------------------------------

membership::verdict membership::take_leave(const sighting& w, time_point now) {
    if (w.announced.node == own_name_ && w.epoch == own_epoch_) {
        return verdict::own;
    }
    const auto until = w.announced_at + interval_of(w.announced, w.from) * 15;
    if (ended_.covers(w.announced.node, w.epoch, w.seq) || until <= now) {
        return verdict::old;
    }
    const auto at = peers_.find(w.announced.node);
    if (at != peers_.end() && at->second.owner.epoch == w.epoch) {
        auto& r = at->second.owner;
        // Without a signature, it would have left in the group.
        if (w.is_signed() ? w.seq <= r.seq : r.from != group_source{} || w.seq < r.seq) {
            return verdict::old;
        }
        r.seq = w.seq;
        r.announced.original = w.announced.original;
        end(at, change::left, now);
        return verdict::taken;
    }
    if (at != peers_.end() && at->second.second && at->second.second->contender.epoch == w.epoch) {
        if (w.is_signed() && w.seq <= at->second.second->contender.seq) {
            return verdict::old;
        }
        drop_second(at);
    }
    ended_.add(w.epoch,
               {.node = w.announced.node,
                .seq = w.seq,
                .at = w.announced_at,
                .until = until,
                .graceful = true,
                .revision = ++revision_,
                .original = w.announced.original},
               now);
    return verdict::taken;
}

// Removes the owner of a name. A live contender takes the name over.
void membership::end(entries::iterator at, change how, time_point now) {
    remember(at->first, at->second.owner, how == change::left, now);
    auto& second = at->second.second;
    if (second && suspect_at(second->contender) > now) {
        succeed(at, std::move(second->contender));
        return;
    }
    drop_second(at);
    by_epoch_.remove(at->second.owner.epoch, &*at);
    const auto name = at->first;
    const std::string where{at->second.owner.where()};
    by_revision_.erase(at->second.in_revision_order);
    peers_.erase(at);
    notify(name, how, where);
}

void membership::succeed(entries::iterator at, incarnation next) {
    drop_second(at);
    by_epoch_.remove(at->second.owner.epoch, &*at);
    by_epoch_.add(next.epoch, &*at);
    next.described_revision = next.revision = ++revision_;
    const auto since = next.last_seen;
    at->second = entry{std::move(next), false, nullptr, at->second.in_revision_order, since};
    freshen(*at);
    follow(suspect_at(at->second.owner));
    const auto name = at->first;
    notify(name, change::moved, at->second.owner.where());
}

void membership::drop_second(entries::iterator at) {
    if (at->second.second) {
        by_epoch_.remove(at->second.second->contender.epoch, &*at);
        at->second.second.reset();
    }
}

void membership::remember(const std::string& node, const incarnation& over, bool graceful, time_point now) {
    if (over.seq != 0 || graceful) { // without `seq`, past and future announcements look the same
        ended_.add(over.epoch,
                   {.node = node,
                    .seq = over.seq,
                    .at = now,
                    .until = now + interval_of(over.announced, over.from) * 15,
                    .graceful = graceful,
                    .revision = graceful ? ++revision_ : 0,
                    .original = over.announced.original,
                    .last_seen = over.last_seen + interval_of(over.announced, over.from) / 2},
                   now);
    }
}

// -- time ----------------------------------------------------------------------------------------------------------

// A node that has just started knows few others. The interval that it announces is then shorter than the time that
// gossip takes to arrive here.
std::chrono::milliseconds membership::interval_of(const announcement& said, const group_source& from) const {
    return from == group_source{} ? std::max(said.interval, interval_among(peers_.size())) : said.interval;
}

bool membership::is_stale(const sighting& w, time_point now) const {
    return w.is_from_gossip() && now - w.announced_at >= interval_of(w.announced, w.from) * 7 / 2;
}

time_point membership::suspect_at(const incarnation& r) const {
    return std::max(r.last_seen, resumed_at_) + interval_of(r.announced, r.from) * 7 / 2;
}

time_point membership::expires_at(const incarnation& r) const {
    return std::max(r.last_seen, resumed_at_) + interval_of(r.announced, r.from) * 15;
}

void membership::follow(time_point due) {
    if (!armed() || due < this->due()) {
        deadlines_.arm(*this, due);
    }
}

// Checks all nodes and arms the timer for the earliest: cheaper than rearming it on each announcement.
void membership::on_deadline(time_point now) {
    for (auto at = peers_.begin(); at != peers_.end();) {
        const auto here = at++;
        auto& e = here->second;
        if (e.second && suspect_at(e.second->contender) <= now) {
            drop_second(here);
        }
        if (now >= expires_at(e.owner) || (e.second && now >= suspect_at(e.owner))) {
            end(here, change::gone, now);
        } else if (!e.suspect && now >= suspect_at(e.owner)) {
            e.suspect = true;
            notify(here->first, change::silent, e.owner.where());
        }
    }
    if (own_name_conflict_ && suspect_at(own_name_conflict_->contender) <= now) {
        own_name_conflict_.reset();
    }
    for (const auto& [name, e] : peers_) {
        follow(e.suspect ? expires_at(e.owner) : suspect_at(e.owner));
        if (e.second) {
            follow(suspect_at(e.second->contender));
        }
    }
    if (own_name_conflict_) {
        follow(suspect_at(own_name_conflict_->contender));
    }
}

void membership::notify(std::string_view node, change what, std::string_view where) const {
    if (watcher_ != nullptr) {
        watcher_->on_peer(node, what, where);
    }
    notify_seen(node);
}

void membership::notify_seen(std::string_view node) const {
    if (on_seen_) {
        on_seen_(node);
    }
}

// -- queries -------------------------------------------------------------------------------------------------------

const incarnation* membership::owner(std::string_view node) const noexcept {
    const auto at = peers_.find(node);
    return at == peers_.end() ? nullptr : &at->second.owner;
}

std::optional<std::string_view> membership::address_of(std::string_view node) const noexcept {
    const auto* const run = owner(node);
    return run == nullptr ? std::nullopt : std::optional{run->where()};
}

const std::string* membership::owner_of(std::uint32_t epoch) const noexcept {
    const auto* const found = by_epoch_.find(epoch);
    return found != nullptr && found->second.owner.epoch == epoch ? &found->first : nullptr;
}

void membership::prefer_address(std::string_view node, std::string_view epoch, std::string_view url, bool announced) {
    const auto at = peers_.find(node);
    if (at == peers_.end() || protocol::epoch_text(at->second.owner.epoch) != epoch) {
        return;
    }
    auto& all = at->second.owner.endpoints;
    const auto scheme = url.substr(0, url.find(':') + 1);
    if (at->second.owner.from != group_source{} || all.empty() || all.front() == url ||
        !all.front().starts_with(scheme) || (announced && std::ranges::find(all, url) == all.end())) {
        return;
    }
    std::erase(all, url);
    all.emplace(all.begin(), url);
    notify(at->first, change::moved, url);
}

void membership::touch(std::string_view node) {
    if (node == own_name_ && own_) {
        own_->revision = ++revision_;
        return;
    }
    if (const auto at = peers_.find(node); at != peers_.end()) {
        at->second.owner.revision = ++revision_;
        freshen(*at);
    }
}

void membership::touch(std::uint32_t epoch) {
    auto* const found = by_epoch_.find(epoch);
    if (found != nullptr && found->second.owner.epoch == epoch) {
        found->second.owner.revision = ++revision_;
        freshen(*found);
    }
}

const incarnation* membership::announced(std::string_view node) const noexcept {
    const auto* const run = owner(node);
    return run != nullptr && run->from != group_source{} ? run : nullptr;
}

std::optional<membership::member> membership::find_member(std::string_view node) const {
    const auto found = peers_.find(node);
    return found == peers_.end() ? std::nullopt : std::optional{member_of(*found)};
}

std::optional<membership::member> membership::next_member(std::string_view node) const {
    if (peers_.empty()) {
        return {};
    }
    auto next = peers_.upper_bound(node);
    if (next == peers_.end()) {
        next = peers_.begin();
    }
    return member_of(*next);
}

membership::member membership::at(std::size_t index) const {
    const auto found = std::next(peers_.begin(), static_cast<std::ptrdiff_t>(index));
    return member_of(*found);
}

std::vector<delta_entry> membership::deltas_since(std::uint64_t revision, time_point now) const {
    using kind = delta_entry::kind;
    std::vector<delta_entry> items;
    const auto add = [&](const std::string& node, const incarnation& r, peer_state state, bool in_full) {
        if (r.revision > revision) {
            const bool describes = in_full || r.described_revision > revision;
            items.push_back(delta_entry::of(describes ? kind::description : kind::heartbeat, node, r, state));
        }
    };
    if (own_ && own_->announced.leaving) {
        if (own_->revision > revision) {
            items.push_back(delta_entry::of(kind::leave, own_name_, *own_, peer_state::live));
        }
    } else if (own_) {
        add(own_name_, *own_, peer_state::live, by_epoch_.contains(own_epoch_));
    }
    for (auto i = by_revision_.end(); i != by_revision_.begin();) {
        const auto& [name, e] = **--i;
        if (e.owner.revision <= revision && (!e.second || e.second->contender.revision <= revision)) {
            break;
        }
        add(name, e.owner, e.state(), e.owner.epoch == own_epoch_ || by_epoch_.is_shared(e.owner.epoch));
        if (e.second) {
            add(name, e.second->contender, peer_state::clash, true);
        }
    }
    for (const auto& [epoch, ended] : ended_.all()) {
        if (ended.graceful && ended.revision > revision && ended.until > now) {
            items.push_back({.what = kind::leave,
                             .node = ended.node,
                             .epoch = epoch,
                             .seq = ended.seq,
                             .last_seen = ended.at,
                             .revision = ended.revision,
                             .original = ended.original.get()});
        }
    }
    std::sort(items.begin(), items.end(), [](const auto& a, const auto& b) { return a.revision < b.revision; });
    return items;
}

std::optional<delta_entry> membership::description_of(std::uint32_t epoch) const {
    const auto* found = by_epoch_.find(epoch);
    if (found == nullptr || found->second.owner.epoch != epoch) {
        return {};
    }
    const auto& [name, e] = *found;
    return delta_entry::of(delta_entry::kind::description, name, e.owner, e.state());
}

std::optional<delta_entry> membership::entry_of(std::string_view node) const {
    if (node == own_name_ && own_) {
        return delta_entry::of(delta_entry::kind::heartbeat, own_name_, *own_, peer_state::live);
    }
    const auto at = peers_.find(node);
    return at == peers_.end() ? std::nullopt
                              : std::optional{delta_entry::of(delta_entry::kind::heartbeat, at->first, at->second.owner,
                                                              at->second.state())};
}

std::vector<peer> membership::list(time_point now) const {
    const auto peer_of = [&](const incarnation& r, peer_state state) -> peer {
        return {.node = r.announced.node,
                .endpoints = r.endpoints,
                .epoch = protocol::epoch_text(r.epoch),
                .age = std::chrono::duration_cast<std::chrono::milliseconds>(now - r.last_seen),
                .state = state,
                .load = r.announced.load,
                .tasks = r.announced.tasks};
    };
    std::vector<peer> all;
    for (const auto& [name, e] : peers_) {
        all.push_back(peer_of(e.owner, e.state()));
        if (e.second && e.second->is_reported) {
            all.push_back(peer_of(e.second->contender, peer_state::clash));
        }
    }
    if (own_name_conflict_ && own_name_conflict_->is_reported) {
        const auto next = std::find_if(all.begin(), all.end(), [&](const peer& p) { return own_name_ < p.node; });
        all.insert(next, peer_of(own_name_conflict_->contender, peer_state::clash));
    }
    return all;
}

} // namespace cles::core

namespace cles {

std::string_view to_string(peer_state state) noexcept {
    switch (state) {
    case peer_state::live: return "live";
    case peer_state::suspect: return "suspect";
    case peer_state::clash: return "clash";
    }
    return "";
}

} // namespace cles
