// SPDX-License-Identifier: BSL-1.0
#include "node/membership/direct_links.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

bool contains(const std::vector<std::string>& names, std::string_view name) {
    return names.empty() || std::ranges::find(names, name) != names.end();
}

} // namespace

bool direct_links::allows(std::string_view node, const membership& others) const {
    const auto* const run = others.owner(node);
    return contains(allowed_, node) && (run == nullptr || contains(run->announced.links, own_name_));
}

bool direct_links::is_lost(const failure& f, const incarnation* owner) {
    return f.alive || (owner != nullptr && owner->last_seen > f.first);
}

const direct_links::failure* direct_links::find_failure(std::string_view node) const noexcept {
    const auto at = tried_.find(node);
    return at != tried_.end() && at->second ? &*at->second : nullptr;
}

direct_links::state direct_links::state_of(std::string_view node, const membership& others) const {
    if (!contains(allowed_, node)) { // most nodes, where only neighbours are
        return state::none;
    }
    const auto* const owner = others.owner(node);
    return owner != nullptr ? state_of(node, *owner) : state::none;
}

direct_links::state direct_links::state_of(std::string_view node, const incarnation& owner) const {
    if (!contains(allowed_, node) || owner.where().empty() || !contains(owner.announced.links, own_name_)) {
        return state::none;
    }
    const auto at = tried_.find(node);
    if (at == tried_.end()) {
        return state::untried;
    }
    const auto& failed = at->second;
    return !failed ? state::open : is_lost(*failed, &owner) ? state::lost : state::silent;
}

time_point direct_links::failed_at(std::string_view node) const {
    const auto* const failed = find_failure(node);
    return failed == nullptr ? time_point::max() : failed->first;
}

bool direct_links::is_due(std::string_view node, time_point now) const {
    const auto* const failed = find_failure(node);
    return failed != nullptr && failed->next <= now;
}

bool direct_links::on_failure(std::string_view node, time_point now) {
    auto& failed = tried_[std::string{node}];
    const bool is_new = !failed;
    if (is_new) {
        failed.emplace().first = now;
    }
    if (failed->next <= now || is_new) { // otherwise it is the same attempt
        failed->next = now + failed->pause.take(max_pause);
    }
    return is_new;
}

void direct_links::on_alive(std::string_view node) {
    if (const auto at = tried_.find(node); at != tried_.end() && at->second) {
        at->second->alive = true;
    }
}

std::vector<std::string> direct_links::take_lost(const membership& others) {
    std::vector<std::string> found;
    for (auto& [node, failed] : tried_) {
        if (failed && !failed->is_reported && is_lost(*failed, others.owner(node))) {
            failed->is_reported = true;
            found.push_back(node);
        }
    }
    return found;
}

bool direct_links::on_success(std::string_view node) {
    auto at = tried_.find(node);
    if (at == tried_.end()) {
        at = tried_.try_emplace(std::string{node}).first;
    }
    return std::exchange(at->second, std::nullopt).has_value();
}

void direct_links::forget(std::string_view node) {
    if (const auto at = tried_.find(node); at != tried_.end()) {
        tried_.erase(at);
    }
}

} // namespace cles::core
