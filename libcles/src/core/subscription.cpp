// SPDX-License-Identifier: BSL-1.0
#include "core/subscription.hpp"

#include <algorithm>

namespace cles::core {

namespace {

// At the other end of a link `self` is a node that has a name too, and it holds one binding of a noun for the link.
bool overlap(std::string_view a, std::string_view b) noexcept { return a == b || a == "self" || b == "self"; }

} // namespace

bool subscription::take(const protocol::request_line& update) {
    const auto before = order_;
    const auto verdict = order_.take(*update.epoch, *update.seq);
    if (!verdict.news) {
        return false;
    }
    detail::raw_event event{.body = update.body.empty() ? std::string_view{"{}"} : update.body,
                            .publisher = update.noun.target,
                            .seq = *update.seq};
    if (verdict.missed != 0 && !thinned_) {
        event.checked = event.has_json();
        if (!event.checked) {
            order_ = before;
            return false;
        }
        on_event({.kind = feed_event::gap, .publisher = event.publisher, .seq = event.seq, .missed = verdict.missed});
    }
    // Once it has been handed on, this may be gone: whoever took it may have closed the feed.
    if (on_event(event)) {
        return true;
    }
    order_ = before; // a later update shows that this one is missing
    return false;
}

bool subscriptions::has(std::string_view target, std::string_view path) const {
    const auto found = by_path_.find(path);
    return found != by_path_.end() && std::any_of(found->second.begin(), found->second.end(),
                                                  [&](const auto* s) { return overlap(s->target(), target); });
}

bool subscriptions::add(subscription& s) {
    if (has(s.target(), s.path())) {
        return false;
    }
    forget_last();
    by_path_[s.path()].push_back(&s);
    return true;
}

void subscriptions::remove(const subscription& s) {
    forget_last();
    const auto found = by_path_.find(s.path());
    if (found != by_path_.end()) {
        std::erase(found->second, &s);
        if (found->second.empty()) {
            by_path_.erase(found);
        }
    }
}

subscription* subscriptions::find(std::string_view publisher, std::string_view path) const {
    const auto found = by_path_.find(path);
    if (found == by_path_.end()) {
        return nullptr;
    }
    for (auto* s : found->second) {
        if (s->target() == publisher || s->target() == "self") { // whoever is at the other end; no other is beside it
            return s;
        }
    }
    return nullptr;
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
