// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip_contacts.hpp"

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

gossip_contact& gossip_contacts::add(part as, std::string_view node, std::string_view url, time_point now) {
    contact c;
    c.as = as;
    c.node = node;
    c.url = url;
    c.next = now;
    return all_.emplace_back(std::move(c));
}

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

std::vector<std::string> gossip_contacts::take_ended() {
    std::vector<std::string> urls;
    for (const auto& c : all_) {
        if (c.ended && first_of(all_, [&c](const contact& other) { return other.url == c.url; }) == nullptr) {
            urls.push_back(c.url);
        }
    }
    std::erase_if(all_, [](const contact& c) { return c.ended; });
    return urls;
}

} // namespace cles::core
