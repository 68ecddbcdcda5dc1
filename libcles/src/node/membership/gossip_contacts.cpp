// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip_contacts.hpp"

#include "protocol/request_line.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

constexpr std::size_t max_resting = 64;

template <class Contacts, class Condition>
auto* first_of(Contacts& all, Condition&& fits) noexcept {
    const auto found = std::find_if(all.begin(), all.end(), [&](const auto& c) { return !c.ended && fits(c); });
    return found == all.end() ? nullptr : &*found;
}

} // namespace

gossip_contact* gossip_contacts::find_ticket(std::uint64_t ticket) noexcept {
    return first_of(all_, [ticket](const contact& c) { return c.ticket == ticket; });
}

gossip_contact* gossip_contacts::find_node(std::string_view node) noexcept {
    return first_of(all_, [node](const contact& c) { return c.node == node; });
}

gossip_contact* gossip_contacts::find(part as) noexcept {
    return first_of(all_, [as](const contact& c) { return c.as == as; });
}

std::size_t gossip_contacts::count(part as) const noexcept {
    return static_cast<std::size_t>(
        std::count_if(all_.begin(), all_.end(), [as](const contact& c) { return c.as == as && !c.ended; }));
}

void gossip_contacts::rest(std::string_view node, time_point until) {
    if (resting_.size() < max_resting) {
        resting_.push_back({std::string{node}, until});
    }
}

bool gossip_contacts::rests(std::string_view node, time_point now) const noexcept {
    return std::any_of(resting_.begin(), resting_.end(),
                       [&](const resting& r) { return r.node == node && r.until > now; });
}

void gossip_contacts::expire_resting(time_point now) {
    std::erase_if(resting_, [now](const resting& r) { return r.until <= now; });
}

std::vector<gossip_contact> gossip_contacts::take_ended(bool by_name) {
    std::vector<contact> found;
    for (const auto& c : all_) {
        const auto is_at_same_place = [&](const contact& other) {
            return other.url == c.url && (!by_name || other.node == c.node);
        };
        if (c.ended && first_of(all_, is_at_same_place) == nullptr) {
            found.push_back(c);
        }
    }
    std::erase_if(all_, [](const contact& c) { return c.ended; });
    return found;
}

// -- candidates ----------------------------------------------------------------------------------------------------

void seeds::set(const std::vector<std::string>& urls) {
    std::vector<seed> now;
    for (const auto& url : urls) {
        const auto same = [&url](const seed& s) { return s.url == url; };
        const auto known = std::find_if(all_.begin(), all_.end(), same);
        if (std::none_of(now.begin(), now.end(), same)) {
            now.push_back(known == all_.end() ? seed{.url = url} : std::move(*known));
        }
    }
    all_ = std::move(now);
}

std::optional<std::string> seeds::due(const membership& others, time_point now, std::chrono::milliseconds rest) {
    for (auto& s : all_) {
        if (s.self || s.next > now) {
            continue;
        }
        const auto known = s.node.empty() ? std::nullopt : others.find_member(s.node);
        if (known && !known->suspect) {
            s.pause = doubling_pause{first_pause};
            s.next = now + rest;
            continue;
        }
        const auto pause = s.pause.take(rest);
        s.next = now + pause - jitter_.quarter_of(pause);
        return s.url;
    }
    return {};
}

std::optional<time_point> seeds::next() const noexcept {
    std::optional<time_point> soonest;
    for (const auto& s : all_) {
        if (!s.self && (!soonest || s.next < *soonest)) {
            soonest = s.next;
        }
    }
    return soonest;
}

void seeds::on_answer(std::string_view url, std::string_view node) {
    for (auto& s : all_) {
        if (s.url == url) {
            s.node = node;
        }
    }
}

void seeds::on_self(std::string_view url) {
    for (auto& s : all_) {
        s.self |= s.url == url;
    }
}

bool seeds::on_heard(std::string_view url) {
    bool is_news = false;
    for (auto& s : all_) {
        is_news |= s.url == url && !std::exchange(s.heard, true);
    }
    return is_news && all_heard();
}

bool seeds::all_heard() const { return std::ranges::all_of(all_, &seed::heard); }

void seeds::prefer_in(membership& others) const {
    for (const auto& s : all_) {
        const auto known = s.node.empty() ? std::nullopt : others.find_member(s.node);
        const auto is_in_use = [&](const seed& other) { return other.node == s.node && other.url == known->where; };
        if (known && std::none_of(all_.begin(), all_.end(), is_in_use)) {
            others.prefer_address(s.node, protocol::epoch_text(known->epoch), s.url, true);
        }
    }
}

void lost_nodes::add(std::string_view name, std::string_view url, time_point now) {
    if (url.empty() || max_entries_ == 0) {
        return;
    }
    std::erase_if(lost_, [name](const node& n) { return n.name == name; });
    node lost{std::string{name}, std::string{url}, now + remembered};
    if (lost_.size() < max_entries_) {
        lost_.push_back(std::move(lost));
    } else {
        lost_[jitter_.below(lost_.size())] = std::move(lost);
    }
}

std::optional<lost_nodes::node> lost_nodes::any(const membership& others, time_point now) {
    std::erase_if(lost_, [&](const node& n) { return n.until <= now || others.address_of(n.name); });
    auto candidates = lost_;
    others.for_each([&](const membership::member& k) {
        if (k.suspect && !k.where.empty()) {
            candidates.push_back({std::string{k.node}, std::string{k.where}, {}});
        }
    });
    if (candidates.empty()) {
        return {};
    }
    return std::move(candidates[jitter_.below(candidates.size())]);
}

bool announce_only_nodes::add(const membership& others, std::string_view node, time_point until, time_point now) {
    const auto* const known = others.announced(node);
    if (known == nullptr) {
        return false;
    }
    if (all_.size() >= others.max_peers()) {
        std::erase_if(all_, [now](const auto& one) { return one.second.until <= now; });
    }
    if (all_.size() >= others.max_peers()) {
        return false;
    }
    all_.insert_or_assign(std::string{node}, entry{known->epoch, until});
    return true;
}

bool announce_only_nodes::contain(const membership::member& k, time_point now) const {
    const auto found = all_.find(k.node);
    return found != all_.end() && found->second.epoch == k.epoch && found->second.until > now;
}

std::size_t announce_only_nodes::count_gossiping(const membership& others, time_point now) const {
    const auto plain = std::count_if(all_.begin(), all_.end(), [&](const auto& one) {
        const auto known = others.find_member(one.first);
        return known && contain(*known, now);
    });
    return others.size() - static_cast<std::size_t>(plain);
}

} // namespace cles::core
