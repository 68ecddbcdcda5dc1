// SPDX-License-Identifier: BSL-1.0
#include "node/membership/reachability.hpp"

#include "node/session/request_checks.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

constexpr std::uint64_t max_number = std::uint64_t{1} << 62U; // leaves room to count
// By so much greater than the known one: no node reaches it by itself within an interval.
constexpr std::uint64_t number_of_life = 2;

} // namespace

// -- for the rest of the node ----------------------------------------------------------------------------------------

void reachability::allow_only(std::vector<std::string> nodes) {
    std::vector<std::string> before;
    others_.for_each([&](const membership::member& k) {
        if (allows(k.node)) {
            before.emplace_back(k.node);
        }
    });
    direct_.allow_only(std::move(nodes));
    std::vector<std::string> changed;
    others_.for_each([&](const membership::member& k) {
        if (allows(k.node) != std::ranges::binary_search(before, k.node)) {
            changed.emplace_back(k.node);
        }
    });
    for (const auto& node : changed) {
        on_links_announced(node);
    }
}

bool reachability::is_direct(direct_links::state now) noexcept {
    return now != direct_links::state::none && now != direct_links::state::lost;
}

bool reachability::is_usable(std::string_view neighbour) const {
    using enum direct_links::state;
    const auto now = direct_.state_of(neighbour, others_);
    return now == untried || now == open;
}

bool reachability::may_ask(std::string_view node, time_point now) const {
    return is_direct(node) ||
           (direct_.is_due(node, now) && direct_.state_of(node, others_) == direct_links::state::lost);
}

std::string reachability::next_hop_to(std::string_view node, std::string_view via, std::string_view requester) const {
    if (is_direct(node)) {
        return std::string{node};
    }
    const auto* const route = routes_.find_route(node, usable(), [&](std::string_view by) {
        return is_in_via(via, by) || (!requester.empty() && by != node && !out_.may_forward(by, requester));
    });
    if (route != nullptr) {
        return route->by;
    }
    return !address_of(node).empty() && allows(node) ? std::string{node} : std::string{}; // a last attempt
}

bool reachability::is_beyond(std::string_view node) const {
    return others_.address_of(node) && next_hop_to(node, {}) != node;
}

std::optional<unsigned> reachability::hops_to(std::string_view node) const {
    if (is_direct(node)) {
        return 1U;
    }
    const auto* const route = routes_.find_route(node, usable());
    return route == nullptr ? std::nullopt : std::optional{route->hops + 1};
}

void reachability::add_routes(std::vector<peer>& all) const {
    for (auto& p : all) {
        if (auto hop = p.state == peer_state::clash ? p.node : next_hop_to(p.node, {}); hop != p.node) {
            p.via = std::move(hop);
            p.hops = hops_to(p.node).value_or(0);
        }
    }
}

// That somebody accepts a link there does not show that it is the node, but the attempts to reach it no longer fail.
void reachability::on_opened(std::string_view node) {
    if (direct_.has_failed(node)) {
        on_reached(node);
    }
}

void reachability::on_reached(std::string_view node) {
    if (direct_.on_success(node)) {
        reconsider(node);
    }
}

void reachability::on_links_announced(std::string_view node) {
    reconsider(node);
    if (!allows(node)) {
        out_.on_route_lost(node, address_of(node));
        leave(node);
    }
}

void reachability::on_new_incarnation(std::string_view node) {
    direct_.forget(node);
    routes_.forget(node);
}

// All routes are compared again. A feed over one that no longer counts binds by another.
void reachability::on_rights_changed() {
    for (const auto& name : routes_.destinations()) {
        for (const auto& by : routes_.neighbours_of(name)) {
            if (by != name && !out_.may_forward(by, {})) {
                out_.on_route_lost(name, address_of(by));
            }
        }
        others_.touch(name);
        out_.on_route_changed(name);
        unsent_.try_emplace(name);
        request_if_needed(name);
    }
}

// -- the need for routes ---------------------------------------------------------------------------------------------

// A link that has just been lost may be repaired soon. Until then, the neighbours' own links are enough. Nodes that
// announce no usable address are no reason: each host may have some, of its own.
unsigned reachability::own_need(time_point now) const {
    if (!direct_.allowed().empty()) {
        return everywhere;
    }
    unsigned need = 0;
    others_.for_each_live([&](const std::string& node, const incarnation& owner) {
        if (need < everywhere && !is_direct(direct_.state_of(node, owner)) && !owner.where().empty()) {
            const bool lasts = !allows(node) || direct_.failed_at(node) <= now - interval() * intervals_of_need;
            need = lasts ? everywhere : 1;
        }
    });
    return need;
}

unsigned reachability::need(time_point now) const noexcept {
    return std::max(own_need_, now < others_need_until_ ? others_need_ : 0);
}

void reachability::review(time_point now) {
    own_need_ = own_need(now);
    report_lost_links();
}

void reachability::on_question(const protocol::routes_question& asked, time_point now) {
    if (now >= others_need_until_ || asked.distance > others_need_) {
        others_need_ = asked.distance - 1;
        others_need_until_ = now + interval() * intervals_of_need;
    }
    if (now - interval_began_ >= interval()) {
        interval_began_ = now;
        number_ = std::min(number_ + 1, max_number);
    }
}

// -- routes ----------------------------------------------------------------------------------------------------------

route_table::usable_function reachability::usable_now() const {
    return [this, known = std::vector<std::pair<std::string, bool>>{}](std::string_view by) mutable {
        const auto found = std::ranges::find(known, by, &std::pair<std::string, bool>::first);
        if (found != known.end()) {
            return found->second;
        }
        return known.emplace_back(by, is_usable(by) && out_.may_forward(by, {})).second;
    };
}

route_function reachability::adverts_to(std::string_view to) {
    return [this, to = std::string{to}, works = usable_now()](const delta_entry& item) {
        return advert_of(item, to, works);
    };
}

std::optional<route_advert> reachability::advert_of(const delta_entry& item, std::string_view to,
                                                    const route_table::usable_function& works) {
    if (item.what == delta_entry::kind::leave || item.state == peer_state::clash) {
        return {};
    }
    if (item.node == own_name_) {
        return route_advert{number_, 0};
    }
    if (!out_.forwards_for(to) || item.node == to || !out_.is_member(item.node)) {
        return {};
    }
    const bool direct = direct_.state_of(item.node, others_) == direct_links::state::open;
    return routes_.advertise(item.node, item.epoch, direct, works, to);
}

void reachability::on_reply(const peer_table& table) {
    on_reached(table.node);
    apply(table);
}

// What a neighbour may state: a route of no links to itself, and as a forwarder longer ones to others.
void reachability::apply(const peer_table& table) {
    const bool forwards = out_.may_forward(table.node, {});
    const auto works = usable_now();
    for (const auto& [epoch, advert] : table.routes) {
        if (advert.seq > max_number) {
            continue;
        }
        if (others_.own() != nullptr && others_.own()->epoch == epoch) { // nobody may be ahead of this node
            number_ = forwards ? std::max(number_, advert.seq) : number_;
            continue;
        }
        const auto* const node = others_.owner_of(epoch);
        const bool is_own = node != nullptr && *node == table.node;
        if (node == nullptr || (advert.hops && (*advert.hops == 0) != is_own) ||
            !(is_own || (forwards && out_.is_member(*node)))) {
            continue;
        }
        apply(std::string{*node}, epoch, table.node, advert, works);
    }
    report_lost_links();
}

void reachability::apply(const std::string& name, std::uint32_t epoch, std::string_view neighbour, route_advert advert,
                         const route_table::usable_function& works) {
    const auto found = routes_.apply(name, epoch, neighbour, advert, works);
    const auto& [was_offered, before, after, requested, missing] = found;
    auto number = requested;
    if (before != after) {
        others_.touch(epoch);
        if (missing != 0 && !is_usable(name)) {
            request(name, missing, everywhere);
            number = std::max(number, missing);
        }
    }
    if (before.by != after.by) {
        out_.on_route_changed(name);
    }
    if (advert.hops && advert.seq >= number) {
        direct_.on_alive(name);
    }
    if (before.by.empty() != after.by.empty() || before.hops != after.hops ||
        (before.seq < number && after.seq >= number)) {
        unsent_.try_emplace(name);
    }
    if (was_offered && !advert.hops && name != neighbour) {
        out_.on_route_lost(name, address_of(neighbour));
    }
}

void reachability::on_pushed(const peer_table& table) {
    apply(table);
    for (const auto& each : table.wanted) {
        answer(each, table.node);
    }
}

// With its own number, or with a route that has the number; or by asking others (Babel, RFC 8966, section 3.8.1.2).
void reachability::answer(const peer_table::route& wanted, std::string_view neighbour) {
    const auto& [epoch, asked] = wanted;
    if (others_.own() != nullptr && others_.own()->epoch == epoch) {
        number_ = std::max(number_, std::min({asked.seq, number_ + number_of_life, max_number}));
        others_.touch(own_name_);
        unsent_.try_emplace(own_name_);
        return;
    }
    const auto* const node = others_.owner_of(epoch);
    if (node == nullptr || !out_.forwards_for(neighbour) || !out_.is_member(*node)) {
        return;
    }
    const auto item = others_.entry_of(*node);
    const auto known = advert_of(*item, neighbour);
    if (known && known->hops && known->seq >= asked.seq) {
        unsent_.try_emplace(*node);
    } else if (asked.hops.value_or(0) > 1 && asked.seq <= routes_.newest(*node) + route_table::max_late) {
        request(*node, asked.seq, std::min(*asked.hops, everywhere) - 1);
    }
}

void reachability::request(const std::string& node, std::uint64_t number, unsigned distance) {
    if (const auto item = others_.entry_of(node); item && routes_.request(node, item->epoch, number)) {
        unsent_[node] = route_advert{number, distance};
    }
}

void reachability::request_if_needed(const std::string& node) {
    if (const auto missing = is_usable(node) ? 0 : routes_.missing_number(node, usable())) {
        request(node, missing, everywhere);
    }
}

void reachability::report_lost_links() {
    for (const auto& node : direct_.take_lost(others_)) {
        reconsider(node);
        out_.on_route_lost(node, address_of(node));
    }
}

void reachability::lose(std::string_view neighbour, time_point now) {
    if (!others_.address_of(neighbour) || !direct_.on_failure(neighbour, now)) {
        return;
    }
    reconsider(neighbour);
    leave(neighbour);
    // A number that the node can have stated only after that shows that it is alive.
    request(std::string{neighbour}, routes_.newest(neighbour) + number_of_life, everywhere);
}

// It cannot be used: other routes than those through it count.
void reachability::leave(std::string_view neighbour) {
    for (const auto& name : routes_.destinations_by(neighbour)) {
        if (name != neighbour) {
            out_.on_route_lost(name, address_of(neighbour));
        }
        unsent_.try_emplace(name);
        request_if_needed(name);
    }
}

// Whether that neighbour can be used has changed.
void reachability::reconsider(std::string_view neighbour) {
    out_.on_route_changed(neighbour);
    for (const auto& name : routes_.destinations_by(neighbour)) {
        others_.touch(name);
        out_.on_route_changed(name);
    }
}

reachability::news reachability::take_unsent(time_point now) {
    if (unsent_.empty() || now < next_push_) {
        return {};
    }
    next_push_ = now + interval() / pushes_per_interval;
    return std::exchange(unsent_, {});
}

} // namespace cles::core
