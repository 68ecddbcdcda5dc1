// SPDX-License-Identifier: BSL-1.0
#include "discovery/node_search.hpp"

#include <cles/error.hpp>

#include "client/client.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/time_left.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

void add_unknown(std::vector<listed_node>& nodes, std::vector<listed_node> more) {
    for (auto& node : more) {
        const bool known =
            std::any_of(nodes.begin(), nodes.end(), [&](const listed_node& n) { return n.node == node.node; });
        if (!known) {
            nodes.push_back(std::move(node));
        }
    }
}

asio::awaitable<std::vector<listed_node>> hear_nodes_soon(client& asker, steady::time_point until) {
    while (asker.node().peers().empty() && steady::now() < until) {
        co_await asker.sleep_until(std::min(until, steady::now() + 2ms));
    }
    auto nodes = listed(asker.node().peers());
    const auto usable = std::find_if(nodes.begin(), nodes.end(), [](const listed_node& node) {
        return node.state == "live" && !node.endpoints.empty();
    });
    if (usable != nodes.end()) {
        std::vector<std::string> where{usable->endpoints.front()};
        const auto answers = co_await ask_all(asker, "self:cles/peers", std::move(where), time_left(until));
        add_unknown(nodes, listed(asker.node().peers()));
        if (answers.front().error.empty()) {
            add_unknown(nodes, listed_others(answers.front().json));
        }
    }
    co_return nodes;
}

} // namespace

asio::awaitable<std::vector<listed_node>> find_nodes(client& asker, const address_book& addresses,
                                                     steady::time_point listen_until,
                                                     std::optional<std::chrono::milliseconds> timeout) {
    if (addresses.finds_by_name()) {
        co_await asker.sleep_until(listen_until);
        co_return listed(asker.node().peers());
    }
    const auto options = asker.options_for("self:cles", timeout);
    const cles::json_text itself = co_await asker.node().async_pull("self:cles", options);
    const cles::json_text others = co_await asker.node().async_pull("self:cles/peers", options);
    co_return listed(itself.text, others.text);
}

asio::awaitable<std::vector<listed_node>> find_nodes_soon(client& asker, const address_book& addresses,
                                                          steady::time_point until) {
    if (addresses.finds_by_name()) {
        auto heard = co_await hear_nodes_soon(asker, until);
        co_return heard;
    }
    std::vector<listed_node> nodes;
    if (addresses.has_url()) {
        const auto limit = time_left(until);
        try {
            auto told = co_await find_nodes(asker, addresses, until, limit);
            nodes = std::move(told);
        } catch (const cles::error&) {
            nodes.clear(); // nobody is there
        }
    }
    for (const auto& [name, url] : addresses.peers()) {
        std::vector<listed_node> named{{.node = name, .state = "", .age_ms = {}, .endpoints = {url}, .epoch = {}}};
        add_unknown(nodes, std::move(named));
    }
    co_return nodes;
}

} // namespace tool
