// SPDX-License-Identifier: BSL-1.0
#include "node/membership/direct_links.hpp"

#include <algorithm>

namespace cles::core {
namespace {

bool contains(const std::vector<std::string>& names, std::string_view name) {
    return names.empty() || std::ranges::find(names, name) != names.end();
}

template <class Container>
bool erase_key(Container& from, std::string_view key) {
    const auto at = from.find(key);
    if (at == from.end()) {
        return false;
    }
    from.erase(at);
    return true;
}

} // namespace

bool direct_links::allows(std::string_view node, const membership& others) const {
    const auto* const said = others.announcement_of(node);
    return contains(allowed_, node) && (said == nullptr || contains(said->links, own_name_));
}

bool direct_links::is_lost(const failure& f, std::string_view node, const membership& others) const {
    return f.alive || others.last_seen(node) > f.first;
}

direct_links::state direct_links::state_of(std::string_view node, const membership& others) const {
    if (!contains(allowed_, node)) { // most nodes, where only neighbours are
        return state::none;
    }
    const auto where = others.address_of(node);
    if (!where || where->empty() || !allows(node, others)) {
        return state::none;
    }
    if (const auto failed = failed_.find(node); failed != failed_.end()) {
        return is_lost(failed->second, node, others) ? state::lost : state::silent;
    }
    return open_.contains(node) ? state::open : state::untried;
}

time_point direct_links::failed_at(std::string_view node) const {
    const auto failed = failed_.find(node);
    return failed == failed_.end() ? time_point::max() : failed->second.first;
}

bool direct_links::is_due(std::string_view node, time_point now) const {
    const auto failed = failed_.find(node);
    return failed != failed_.end() && failed->second.next <= now;
}

bool direct_links::on_failure(std::string_view node, time_point now) {
    const auto [at, is_new] = failed_.try_emplace(std::string{node});
    erase_key(open_, node);
    if (is_new) {
        at->second.first = now;
    }
    if (at->second.next <= now || is_new) { // otherwise it is the same attempt
        at->second.next = now + at->second.pause.take(max_pause);
    }
    return is_new;
}

void direct_links::on_alive(std::string_view node) {
    if (const auto at = failed_.find(node); at != failed_.end()) {
        at->second.alive = true;
    }
}

std::vector<std::string> direct_links::take_lost(const membership& others) {
    std::vector<std::string> found;
    for (auto& [node, f] : failed_) {
        if (!f.is_reported && is_lost(f, node, others)) {
            f.is_reported = true;
            found.push_back(node);
        }
    }
    return found;
}

bool direct_links::on_success(std::string_view node) {
    if (!open_.contains(node)) {
        open_.emplace(node);
    }
    return erase_key(failed_, node);
}

void direct_links::forget(std::string_view node) {
    erase_key(failed_, node);
    erase_key(open_, node);
}

} // namespace cles::core
