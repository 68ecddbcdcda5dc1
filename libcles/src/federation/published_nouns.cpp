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
            n.bound.insert(std::move(who.by));
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
        all.insert(n.bound.begin(), n.bound.end());
        for (const auto& who : n.waiting) {
            all.insert(who.by);
        }
    }
    return all;
}

} // namespace cles::bridging
