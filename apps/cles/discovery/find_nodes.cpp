// SPDX-License-Identifier: BSL-1.0
#include "discovery/find_nodes.hpp"

#include <cles/error.hpp>
#include <cles/peer.hpp>

#include "client/client.hpp"
#include "discovery/ask_all.hpp"
#include "options/arguments.hpp"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr std::size_t max_candidates = 8; // if that many nodes do not route, no other will

void add_unknown(std::vector<listed_node>& nodes, std::vector<listed_node> more) {
    for (auto& node : more) {
        const bool known =
            std::any_of(nodes.begin(), nodes.end(), [&](const listed_node& n) { return n.node == node.node; });
        if (!known) {
            nodes.push_back(std::move(node));
        }
    }
}

asio::awaitable<std::vector<listed_node>> find_by_multicast(client& requester, steady::time_point until) {
    while (requester.node().peers().empty() && steady::now() < until) {
        co_await requester.sleep_until(std::min(until, steady::now() + 2ms));
    }
    auto nodes = heard_nodes(requester);
    const auto usable = std::find_if(nodes.begin(), nodes.end(), [](const listed_node& node) {
        return node.state == "live" && !node.endpoints.empty();
    });
    if (usable != nodes.end()) {
        const auto asked = usable->url();
        std::vector<std::string> url{asked};
        const auto answers = co_await ask_all(requester, "self:cles/peers", std::move(url), time_left(until));
        add_unknown(nodes, heard_nodes(requester));
        if (answers.front().error.empty()) {
            add_unknown(nodes, peers_in(asked, answers.front().json));
        }
    }
    co_return nodes;
}

// Announcements do not say which node routes; daemons do, and they have workers.
bool is_likely_router(const cles::peer& node) { return node.load.workers != 0; }

bool is_usable(const cles::peer& node) { return node.state == cles::peer_state::live && !node.endpoints.empty(); }

} // namespace

asio::awaitable<std::vector<listed_node>> find_nodes(client& requester, const address_book& addresses,
                                                     steady::time_point until,
                                                     std::optional<std::chrono::milliseconds> timeout) {
    if (addresses.finds_by_name()) {
        co_await requester.sleep_until(until);
        co_return heard_nodes(requester);
    }
    const auto options = requester.options_for("self:cles", timeout);
    const cles::json_text self = co_await requester.node().async_pull("self:cles", options);
    const cles::json_text peers = co_await requester.node().async_pull("self:cles/peers", options);
    co_return nodes_of(addresses.url_for("self"), self.text, peers.text);
}

asio::awaitable<std::vector<listed_node>> find_nodes_quickly(client& requester, const address_book& addresses,
                                                             steady::time_point until) {
    if (addresses.finds_by_name()) {
        auto found = co_await find_by_multicast(requester, until);
        co_return found;
    }
    std::vector<listed_node> nodes;
    if (addresses.has_url()) {
        const auto limit = time_left(until);
        try {
            auto found = co_await find_nodes(requester, addresses, until, limit);
            nodes = std::move(found);
        } catch (const cles::error&) {
            nodes.clear(); // it does not answer
        }
    }
    for (const auto& [name, url] : addresses.peers()) {
        std::vector<listed_node> named{{.node = name, .state = "", .age_ms = {}, .endpoints = {url}, .epoch = {}}};
        add_unknown(nodes, std::move(named));
    }
    co_return nodes;
}

bool needs_router(const address_book& addresses, std::string_view noun) {
    const auto node = target_of(noun);
    return (node == "any" || node == "all") && addresses.finds_by_name();
}

asio::awaitable<std::vector<std::string>> possible_routers(client& requester, const address_book& addresses) {
    const auto until = steady::now() + discovery_time;
    auto known = requester.node().peers();
    while (steady::now() < until && std::none_of(known.begin(), known.end(), [](const cles::peer& node) {
               return is_usable(node) && is_likely_router(node);
           })) {
        co_await requester.sleep_until(std::min(until, steady::now() + 5ms));
        known = requester.node().peers();
    }
    std::erase_if(known, [](const cles::peer& node) { return !is_usable(node); });
    std::stable_partition(known.begin(), known.end(), is_likely_router);
    known.resize(std::min(known.size(), max_candidates));

    std::vector<std::string> urls;
    urls.reserve(known.size() + 1);
    for (const auto& node : known) {
        urls.push_back(node.endpoints.front());
    }
    if (urls.empty()) {
        urls.emplace_back(addresses.default_node());
    }
    co_return urls;
}

std::vector<listed_node> heard_nodes(client& requester) {
    auto nodes = nodes_of(requester.node().peers());
    for (auto& node : nodes) {
        node.pool = requester.pool();
        // The command answers nobody, so it takes nothing from the node with its name.
        if (node.node == requester.node().name() && node.state == "clash") {
            node.state = "live";
        }
    }
    return nodes;
}

asio::awaitable<heard_datagrams> count_heard(client& requester) {
    heard_datagrams out;
    try {
        out = co_await requester.node().async_pull<heard_datagrams>(requester.node().name() + ":cles/metrics");
    } catch (const cles::error&) { // then the numbers are not known
        out = {};
    }
    co_return out;
}

asio::awaitable<bool> hears_other_pools(client& requester) {
    const auto heard = co_await count_heard(requester);
    co_return heard.announcements_foreign != 0;
}

std::chrono::milliseconds time_left(steady::time_point until) {
    return std::max(1ms, std::chrono::duration_cast<std::chrono::milliseconds>(until - steady::now()));
}

} // namespace tool
