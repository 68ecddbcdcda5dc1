// SPDX-License-Identifier: BSL-1.0
#include "node/publish/subscription.hpp"

#include <algorithm>

namespace cles::core {
namespace {

// `self` is the node at the other end of the link, which also has a name and holds one binding of a noun for the link;
// `all` includes every node.
bool overlap(std::string_view a, std::string_view b) noexcept {
    const auto is_some = [](std::string_view t) { return t == "self" || t == "all"; };
    return a == b || is_some(a) || is_some(b);
}

} // namespace

// -- which updates are new -------------------------------------------------------------------------------------------

std::optional<std::uint64_t> sequence_tracker::take(std::uint32_t epoch, std::uint64_t seq) noexcept {
    if (epoch_ == epoch) {
        if (seq <= seq_) {
            return std::nullopt;
        }
        return seq - std::exchange(seq_, seq) - 1;
    }
    if (std::ranges::find(previous_epochs_, std::optional{epoch}) != previous_epochs_.end()) {
        return std::nullopt;
    }
    if (epoch_) {
        previous_epochs_[next_previous_++ % previous_epochs_.size()] = epoch_;
    }
    epoch_ = epoch;
    seq_ = seq;
    return 0;
}

sequence_tracker& publisher_sequences::of(std::string_view publisher) {
    auto at = sources_.find(publisher);
    if (at == sources_.end()) {
        if (sources_.size() >= max_entries_) {
            sources_.erase(std::ranges::min_element(sources_, {}, [](const auto& s) { return s.second.last_update; }));
        }
        at = sources_.emplace(std::string{publisher}, source{}).first;
    }
    at->second.last_update = ++updates_received_;
    return at->second.order;
}

void publisher_sequences::forget(std::string_view publisher) {
    if (const auto at = sources_.find(publisher); at != sources_.end()) {
        sources_.erase(at);
    }
}

bool subscription::take(const protocol::request_line& update, feed_mailbox::hand_over when) {
    auto& order = each_ ? each_->of(update.noun.target) : order_;
    const auto before = order;
    const auto missed = order.take(*update.epoch, *update.seq);
    if (!missed) {
        return false;
    }
    detail::raw_event event{.body = update.body.empty() ? std::string_view{"{}"} : update.body,
                            .publisher = update.noun.target,
                            .seq = *update.seq,
                            .epoch = *update.epoch,
                            .line = update.text,
                            .reading = update.reading};
    bool taken = true;
    if (*missed != 0 && !thinned_) {
        event.checked = event.has_json();
        taken = event.checked;
        if (taken) {
            on_event({.kind = feed_event::gap,
                      .publisher = update.noun.target,
                      .seq = *update.seq,
                      .epoch = *update.epoch,
                      .missed = *missed},
                     when);
        }
    }
    // After delivery, `order` may be gone: the handler may have closed the feed.
    taken = taken && on_event(event, when);
    if (!taken) { // not JSON: a later update shows that this one is missing
        order = before;
    }
    return taken;
}

void subscription::forget(std::string_view publisher) {
    if (each_) {
        each_->forget(publisher);
    } else if (target_ == publisher) {
        order_ = {};
    }
}

// -- which subscription an update is for -----------------------------------------------------------------------------

std::span<subscription* const> subscriptions::all_of(std::string_view path) const {
    const auto found = by_path_.find(path);
    if (found == by_path_.end()) {
        return {};
    }
    return found->second;
}

bool subscriptions::has(std::string_view target, std::string_view path) const {
    return std::ranges::any_of(all_of(path), [&](const auto* s) { return overlap(s->target(), target); });
}

bool subscriptions::has_bound_for(const subscription& s) const {
    return std::ranges::any_of(
        all_of(s.path()), [&](const auto* other) { return other != &s && other->is_bound() && other->may_share(s); });
}

bool subscriptions::admits(const subscription& s) const {
    return std::ranges::all_of(all_of(s.path()), [&](const auto* other) {
        return other->may_share(s) || !overlap(other->target(), s.target());
    });
}

bool subscriptions::add(subscription& s) {
    if (!admits(s)) {
        return false;
    }
    forget_last();
    s.has_shared_ = false;
    for (auto* other : all_of(s.path())) {
        if (other->may_share(s)) {
            other->has_shared_ = true;
            s.has_shared_ = true;
        }
    }
    sharing_ += s.has_shared_ ? 1 : 0;
    by_path_[s.path()].push_back(&s);
    return true;
}

void subscriptions::remove(const subscription& s) {
    forget_last();
    const auto found = by_path_.find(s.path());
    if (found != by_path_.end()) {
        if (std::erase(found->second, &s) != 0 &&
            std::ranges::any_of(found->second, [&](const auto* other) { return other->may_share(s); })) {
            --sharing_;
        }
        if (found->second.empty()) {
            by_path_.erase(found);
        }
    }
}

subscription* subscriptions::find(std::string_view publisher, std::string_view path) const {
    subscription* of_all = nullptr;
    for (auto* s : all_of(path)) {
        if (s->target() == publisher || s->target() == "self") { // the node at the other end; excludes any other
            return s;
        }
        if (s->target() == "all") {
            of_all = s;
        }
    }
    return of_all;
}

bool subscriptions::deliver(const match& found) {
    if (sharing_ == 0) {
        return found.whose->take(*found.update);
    }
    // User code may remove subscriptions and add others. So the last one receives the update when the list is no longer
    // used, and the others later.
    subscription* last = nullptr;
    bool taken = false;
    for (auto* each : all_of(found.whose->path())) {
        if ((each == found.whose || each->may_share(*found.whose)) && (each->is_bound() || !each->has_shared_)) {
            if (last != nullptr) {
                taken = last->take(*found.update, feed_mailbox::hand_over::later) || taken;
            }
            last = each;
        }
    }
    return (last != nullptr && last->take(*found.update)) || taken;
}

subscriptions::match subscriptions::recognise(std::string_view line) noexcept {
    const auto* update = head_.recognise(line);
    if (update == nullptr) {
        return {};
    }
    last_ = head_of_;
    return {.update = update, .whose = head_of_};
}

subscriptions::match subscriptions::find(std::string_view line, const protocol::request_line& update) {
    auto* s = find(update.noun.target, protocol::canonical_path(update.noun, scratch_));
    if (s != nullptr && s == last_) {
        head_.remember(line, update);
        head_of_ = s;
    }
    last_ = s;
    return {.update = &update, .whose = s};
}

void subscriptions::forget_last() noexcept {
    last_ = nullptr;
    head_of_ = nullptr;
    head_.forget();
}

} // namespace cles::core
