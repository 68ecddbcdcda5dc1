// SPDX-License-Identifier: BSL-1.0
#include "federation/foreign_feeds.hpp"

#include "federation/carried_line.hpp"

#include <tuple>
#include <utility>

namespace cles::bridging {
namespace {

auto subject_key(const foreign_noun& n) { return std::tie(n.pool, n.node, n.task); }

foreign_noun first_of(std::string pool, std::string node, std::string task) {
    return {.pool = std::move(pool), .node = std::move(node), .task = std::move(task), .parameters = {}, .target = {}};
}

} // namespace

bool foreign_feeds::is_subscribed(const foreign_noun& noun) const {
    const auto next = bound_.lower_bound(first_of(noun.pool, noun.node, noun.task));
    return next != bound_.end() && subject_key(next->first) == subject_key(noun);
}

bool foreign_feeds::add(const foreign_noun& noun, std::uint64_t id) {
    const bool is_new = !is_subscribed(noun);
    auto& b = bound_[noun];
    asked_.erase(b.id);
    b.id = id;
    asked_.emplace(id, noun);
    return is_new;
}

std::vector<foreign_feeds::update> foreign_feeds::on_bound(std::uint64_t id, std::string_view taker) {
    const auto asked = asked_.find(id);
    if (asked == asked_.end()) {
        return {};
    }
    auto& [noun, b] = *bound_.find(asked->second);
    asked_.erase(asked);
    b.id = 0;
    b.taker = taker;
    std::vector<update> waiting;
    for (auto& line : std::exchange(b.held, {})) {
        waiting.push_back({noun.on(), std::move(line)});
    }
    return waiting;
}

foreign_feeds::removed foreign_feeds::take(bindings::iterator which) {
    removed gone{.taker = std::move(which->second.taker), .noun = which->first};
    asked_.erase(which->second.id);
    bound_.erase(which);
    gone.is_last = !is_subscribed(gone.noun);
    auto first = gone.noun;
    first.target.clear();
    first.link = 0;
    const auto next = bound_.lower_bound(first);
    gone.is_only = next == bound_.end() || subject_key(next->first) != subject_key(first) ||
                   next->first.parameters != first.parameters;
    return gone;
}

std::optional<foreign_feeds::removed> foreign_feeds::remove(const foreign_noun& noun) {
    const auto found = bound_.find(noun);
    return found == bound_.end() ? std::nullopt : std::optional{take(found)};
}

std::optional<foreign_feeds::removed> foreign_feeds::remove(std::uint64_t id) {
    const auto asked = asked_.find(id);
    return asked == asked_.end() ? std::nullopt : std::optional{take(bound_.find(asked->second))};
}

template <class Condition>
std::vector<foreign_feeds::removed> foreign_feeds::remove_if(Condition concerns) {
    std::vector<removed> all;
    for (auto at = bound_.begin(); at != bound_.end();) {
        const auto here = at++;
        if (concerns(here->first, here->second)) {
            all.push_back(take(here));
        }
    }
    return all;
}

std::vector<foreign_feeds::removed> foreign_feeds::remove_link(const bridge_link& link) {
    return remove_if([&link](const foreign_noun& n, const binding&) { return n.on() == link; });
}

std::vector<foreign_feeds::removed> foreign_feeds::remove_pool(std::string_view pool) {
    return remove_if([pool](const foreign_noun& n, const binding&) { return n.pool == pool; });
}

std::vector<foreign_feeds::removed> foreign_feeds::remove_held(const bridge_id& taker) {
    return remove_if([&taker](const foreign_noun& n, const binding& b) {
        return n.pool == taker.pool && b.taker == taker.instance && b.id == 0;
    });
}

void foreign_feeds::clear() {
    bound_.clear();
    asked_.clear();
}

std::vector<foreign_feeds::update> foreign_feeds::on_update(const subject& about, std::string_view message) {
    std::vector<update> lines;
    const auto first = first_of(about.pool, about.node, about.task);
    for (auto at = bound_.lower_bound(first); at != bound_.end() && subject_key(at->first) == subject_key(first);
         ++at) {
        const auto& [noun, b] = *at;
        const auto& parameters = noun.parameters;
        if (!message.starts_with(parameters) || message.substr(parameters.size(), 1) != " ") {
            continue;
        }
        auto line = text_of(verb::update, noun.target, noun.task, message);
        if (b.id == 0) {
            lines.push_back({noun.on(), std::move(line)});
            continue;
        }
        auto& held = at->second.held;
        held.push_back(std::move(line));
        if (held.size() > max_held) { // shows as a gap
            held.pop_front();
        }
    }
    return lines;
}

} // namespace cles::bridging
