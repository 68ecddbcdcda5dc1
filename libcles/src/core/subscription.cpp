// SPDX-License-Identifier: BSL-1.0
#include "core/subscription.hpp"

#include <algorithm>

namespace cles::core {

bool subscription::take(const protocol::request_line& update) {
    const auto verdict = order_.take(*update.epoch, *update.seq);
    if (!verdict.news) {
        return false;
    }
    detail::raw_event event{.body = update.body.empty() ? std::string_view{"{}"} : update.body,
                            .publisher = update.noun.target,
                            .seq = *update.seq};
    if (verdict.missed != 0 && !thinned_) {
        on_event({.kind = feed_event::gap, .publisher = event.publisher, .seq = event.seq, .missed = verdict.missed});
    }
    on_event(event);
    return true;
}

bool subscriptions::has(std::string_view target, std::string_view path) const {
    const auto found = by_path_.find(path);
    return found != by_path_.end() && std::any_of(found->second.begin(), found->second.end(),
                                                  [&](const auto* s) { return s->target() == target; });
}

bool subscriptions::add(subscription& s) {
    if (has(s.target(), s.path())) {
        return false;
    }
    by_path_[s.path()].push_back(&s);
    return true;
}

void subscriptions::remove(const subscription& s) {
    recent_ = nullptr;
    const auto found = by_path_.find(s.path());
    if (found != by_path_.end()) {
        std::erase(found->second, &s);
        if (found->second.empty()) {
            by_path_.erase(found);
        }
    }
}

subscription* subscriptions::find(std::string_view publisher, std::string_view path) const {
    if (recent_ != nullptr && recent_->path() == path && recent_->target() == publisher) {
        return recent_;
    }
    const auto found = by_path_.find(path);
    if (found == by_path_.end()) {
        return nullptr;
    }
    subscription* by_self = nullptr; // `self` is whoever is at the other end
    for (auto* s : found->second) {
        if (s->target() == publisher) {
            return recent_ = s;
        }
        if (s->target() == "self") {
            by_self = s;
        }
    }
    return by_self;
}

} // namespace cles::core
