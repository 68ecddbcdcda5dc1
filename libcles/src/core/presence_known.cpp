// SPDX-License-Identifier: BSL-1.0
// What a node knows of others, for those who ask it.
#include "core/presence.hpp"
#include "protocol/message.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>

namespace cles::core {

std::optional<std::string_view> presence::find(std::string_view node) const noexcept {
    const auto at = peers_.find(node);
    return at == peers_.end() ? std::nullopt : std::optional{at->second.owner.where()};
}

std::optional<group_source> presence::source_of(std::string_view node) const noexcept {
    const auto* const run = announced(node);
    return run != nullptr ? std::optional{run->from} : std::nullopt;
}

const known_run* presence::announced(std::string_view node) const noexcept {
    const auto found = peers_.find(node);
    return found != peers_.end() && found->second.owner.from != group_source{} ? &found->second.owner : nullptr;
}

std::optional<presence::known> presence::look(std::string_view node) const {
    const auto found = peers_.find(node);
    return found == peers_.end() ? std::nullopt : std::optional{known_of(*found)};
}

std::optional<presence::known> presence::after(std::string_view node) const {
    if (peers_.empty()) {
        return {};
    }
    auto next = peers_.upper_bound(node);
    if (next == peers_.end()) {
        next = peers_.begin();
    }
    return known_of(*next);
}

presence::known presence::at(std::size_t index) const {
    const auto found = std::next(peers_.begin(), static_cast<std::ptrdiff_t>(index));
    return known_of(*found);
}

std::vector<news_item> presence::news_since(std::uint64_t news, time_point now) const {
    using kind = news_item::kind;
    std::vector<news_item> items;
    const auto add = [&](const std::string& node, const known_run& r, peer_state state, bool in_full) {
        if (r.news > news) {
            items.push_back({in_full || r.described > news ? kind::description : kind::beat, node, &r.said,
                             &r.passed_on, r.epoch, r.seq, r.heard, state, r.news});
        }
    };
    const auto add_farewell = [&items](std::string_view node, std::uint32_t epoch, std::uint64_t seq, time_point at,
                                       std::uint64_t of) {
        items.push_back({.what = kind::farewell, .node = node, .epoch = epoch, .seq = seq, .heard = at, .news = of});
    };
    if (own_ && own_->said.leaving) {
        if (own_->news > news) {
            add_farewell(own_name_, own_epoch_, own_->seq, own_->heard, own_->news);
        }
    } else if (own_) {
        add(own_name_, *own_, peer_state::live, by_epoch_.contains(own_epoch_));
    }
    for (auto i = by_news_.end(); i != by_news_.begin();) {
        const auto& [name, e] = **--i;
        if (e.owner.news <= news && (!e.second || e.second->of.news <= news)) {
            break;
        }
        add(name, e.owner, e.suspect ? peer_state::suspect : peer_state::live,
            e.owner.epoch == own_epoch_ || by_epoch_.is_shared(e.owner.epoch));
        if (e.second) {
            add(name, e.second->of, peer_state::clash, true);
        }
    }
    for (const auto& [epoch, ended] : ended_.all()) {
        if (ended.farewell && ended.news > news && ended.until > now) {
            add_farewell(ended.node, epoch, ended.seq, ended.at, ended.news);
        }
    }
    std::sort(items.begin(), items.end(), [](const auto& a, const auto& b) { return a.news < b.news; });
    return items;
}

std::optional<news_item> presence::description_of(std::uint32_t epoch) const {
    const auto* found = by_epoch_.find(epoch);
    if (found == nullptr || found->second.owner.epoch != epoch) {
        return {};
    }
    const auto& [name, e] = *found;
    return news_item{news_item::kind::description,
                     name,
                     &e.owner.said,
                     &e.owner.passed_on,
                     epoch,
                     e.owner.seq,
                     e.owner.heard,
                     e.suspect ? peer_state::suspect : peer_state::live,
                     e.owner.news};
}

std::vector<peer> presence::list(time_point now) const {
    std::vector<peer> all;
    const auto add = [&](const known_run& r, peer_state state) {
        all.push_back({.node = r.said.node,
                       .endpoints = r.endpoints,
                       .epoch = protocol::epoch_text(r.epoch),
                       .age = std::chrono::duration_cast<std::chrono::milliseconds>(now - r.heard),
                       .state = state,
                       .load = r.said.load,
                       .tasks = r.said.tasks});
    };
    const auto add_rival = [&](const std::unique_ptr<rival>& second) {
        if (second && second->clashes) {
            add(second->of, peer_state::clash);
        }
    };
    bool namesake_due = true;
    for (const auto& [name, e] : peers_) {
        if (namesake_due && own_name_ < name) {
            namesake_due = false;
            add_rival(namesake_);
        }
        add(e.owner, e.suspect ? peer_state::suspect : peer_state::live);
        add_rival(e.second);
    }
    if (namesake_due) {
        add_rival(namesake_);
    }
    return all;
}

} // namespace cles::core
