// SPDX-License-Identifier: BSL-1.0
#include "core/subscription.hpp"

#include "core/update_intake.hpp"

#include <algorithm>
#include <iterator>

namespace cles::core {

namespace {

// At the other end of a link `self` is a node that has a name too, and it holds one binding of a noun for the link;
// `all` are all, whatever their names.
bool overlap(std::string_view a, std::string_view b) noexcept {
    const auto is_some = [](std::string_view t) { return t == "self" || t == "all"; };
    return a == b || is_some(a) || is_some(b);
}

} // namespace

bool subscription::take(const protocol::request_line& update) {
    return take_in(each_ ? each_->of(update.noun.target) : order_, update, thinned_,
                   [this](const detail::raw_event& event) { return on_event(event); });
}

bool subscriptions::has(std::string_view target, std::string_view path) const {
    const auto found = by_path_.find(path);
    return found != by_path_.end() && std::any_of(found->second.begin(), found->second.end(),
                                                  [&](const auto* s) { return overlap(s->target(), target); });
}

bool subscriptions::admits(const subscription& s) const {
    const auto found = by_path_.find(s.path());
    return found == by_path_.end() || std::all_of(found->second.begin(), found->second.end(), [&](const auto* other) {
               return other->may_share(s) || !overlap(other->target(), s.target());
           });
}

bool subscriptions::is_shared(const subscription& s) const {
    const auto found = by_path_.find(s.path());
    return found != by_path_.end() && std::any_of(found->second.begin(), found->second.end(), [&](const auto* other) {
               return other != &s && other->may_share(s);
           });
}

bool subscriptions::add(subscription& s) {
    if (!admits(s)) {
        return false;
    }
    forget_last();
    sharing_ += is_shared(s) ? 1 : 0;
    by_path_[s.path()].push_back(&s);
    return true;
}

void subscriptions::remove(const subscription& s) {
    forget_last();
    const auto found = by_path_.find(s.path());
    if (found != by_path_.end()) {
        if (std::erase(found->second, &s) != 0 && is_shared(s)) {
            --sharing_;
        }
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
    subscription* of_all = nullptr;
    for (auto* s : found->second) {
        if (s->target() == publisher || s->target() == "self") { // the node at the other end; no other is beside it
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
    // A callback may end it, or others.
    const std::string path{found.whose->path()};
    const auto& there = by_path_.find(path)->second;
    std::vector<subscription*> all;
    std::copy_if(there.begin(), there.end(), std::back_inserter(all), [&](const auto* other) {
        return other == found.whose || (other->may_share(*found.whose) && other->is_bound());
    });
    bool taken = false;
    for (auto* each : all) {
        const auto now = by_path_.find(path);
        if (now != by_path_.end() && std::find(now->second.begin(), now->second.end(), each) != now->second.end() &&
            each->is_bound()) {
            taken = each->take(*found.update) || taken;
        }
    }
    return taken;
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
