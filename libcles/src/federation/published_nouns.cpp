// SPDX-License-Identifier: BSL-1.0
#include "federation/published_nouns.hpp"

#include <algorithm>
#include <utility>

namespace cles::bridging {

std::uint64_t published_nouns::bind(const std::string& noun, subscriber who) {
    auto& n = nouns_[noun];
    n.waiting.push_back(std::move(who));
    return n.asked != 0 ? 0 : n.asked = next_id();
}

published_nouns::reply published_nouns::on_reply(std::uint64_t id, bool is_failure) {
    const auto found = std::ranges::find_if(nouns_, [id](const auto& each) { return each.second.asked == id; });
    reply made;
    if (found == nouns_.end()) {
        return made;
    }
    auto& n = found->second;
    n.asked = 0;
    made.noun = found->first;
    for (auto& who : std::exchange(n.waiting, {})) {
        if (!is_failure) {
            if (auto& binds = n.bound[who.by]; binds.size() < max_binds) {
                binds.insert(who.reply);
            }
        }
        made.to.push_back(std::move(who.reply));
    }
    if (n.bound.empty()) {
        nouns_.erase(found);
        made.ends = !is_failure; // all have left meanwhile
    }
    return made;
}

bool published_nouns::unbind(const std::string& noun, const bridge_id& by) {
    const auto found = nouns_.find(noun);
    if (found == nouns_.end()) {
        return false;
    }
    auto& n = found->second;
    n.bound.erase(by);
    std::erase_if(n.waiting, [&by](const subscriber& s) { return s.by == by; });
    if (!n.bound.empty() || n.asked != 0) { // `on_reply` sees whether somebody is left
        return false;
    }
    nouns_.erase(found);
    return true;
}

std::optional<std::string> published_nouns::cancel(const subscriber& who) {
    for (auto& [noun, n] : nouns_) {
        const auto bound = n.bound.find(who.by);
        const bool was_bound = bound != n.bound.end() && bound->second.erase(who.reply) != 0;
        if (was_bound && bound->second.empty()) {
            auto ended = noun; // `unbind` may erase it
            return unbind(ended, who.by) ? std::optional{std::move(ended)} : std::nullopt;
        }
        if (was_bound || std::erase(n.waiting, who) != 0) { // `on_reply` sees whether somebody is left
            return {};
        }
    }
    return {};
}

std::vector<std::string> published_nouns::remove(const bridge_id& by) {
    std::vector<std::string> all;
    for (const auto& [noun, n] : nouns_) {
        all.push_back(noun);
    }
    std::erase_if(all, [&](const std::string& noun) { return !unbind(noun, by); });
    return all;
}

std::set<bridge_id> published_nouns::clear() {
    std::set<bridge_id> all;
    for (const auto& [noun, n] : std::exchange(nouns_, {})) {
        for (const auto& [by, binds] : n.bound) {
            all.insert(by);
        }
        for (const auto& who : n.waiting) {
            all.insert(who.by);
        }
    }
    return all;
}

} // namespace cles::bridging
