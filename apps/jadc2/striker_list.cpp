// SPDX-License-Identifier: BSL-1.0
#include "striker_list.hpp"

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>

namespace jadc2 {

std::vector<std::string> striker_list::update(const std::vector<cles::peer>& known, double now) {
    for (auto& [name, node] : nodes_) {
        node.live = false;
    }
    std::vector<std::string> wanted;
    for (const auto& peer : known) {
        auto& node = nodes_[peer.node];
        if (auto version = peer.epoch + " " + peer.tasks; node.version != version) {
            node.version = std::move(version);
            node.asked = false;
            node.ask_after = 0;
        }
        node.live = peer.state == cles::peer_state::live && peer.hops != 0;
        if (node.live && !node.asked && now >= node.ask_after) {
            node.asked = true;
            wanted.push_back(peer.node);
        }
    }
    std::erase_if(nodes_, [](const auto& each) { return !each.second.live && each.second.orders == 0; });
    return wanted;
}

void striker_list::described(const std::string& node, const node_description& by_itself) {
    if (const auto at = nodes_.find(node); at != nodes_.end()) {
        const auto& all = by_itself.tasks;
        at->second.offers = std::any_of(
            all.begin(), all.end(), [](const auto& each) { return each.verb == "DELEGATE" && each.task == "strike"; });
    }
}

void striker_list::failed(const std::string& node, double now) {
    if (const auto at = nodes_.find(node); at != nodes_.end()) {
        at->second.asked = false;
        at->second.ask_after = now + pause_s;
    }
}

void striker_list::avoid(const std::string& node, double now) {
    if (const auto at = nodes_.find(node); at != nodes_.end()) {
        at->second.avoid_until = now + avoided_s;
    }
}

std::vector<std::string> striker_list::candidates(double now) const {
    std::vector<std::tuple<bool, std::uint64_t, std::string>> all;
    for (const auto& [name, node] : nodes_) {
        if (node.live && node.offers) {
            all.emplace_back(now < node.avoid_until, node.orders, name);
        }
    }
    std::sort(all.begin(), all.end());
    std::vector<std::string> names;
    names.reserve(all.size());
    for (auto& [avoided, orders, name] : all) {
        names.push_back(std::move(name));
    }
    return names;
}

void striker_list::gets_order(const std::string& node) {
    if (const auto at = nodes_.find(node); at != nodes_.end()) {
        ++at->second.orders;
    }
}

} // namespace jadc2
