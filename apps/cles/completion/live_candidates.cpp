// SPDX-License-Identifier: BSL-1.0
#include "completion/live_candidates.hpp"

#include <cles/error.hpp>

#include "client/client.hpp"
#include "client/offered_tasks.hpp"
#include "client/told_types.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "output/json_node.hpp"

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <utility>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr std::size_t max_described = 32; // that many nodes answer in time, and are enough

void add_once(std::vector<candidate>& out, candidate more) {
    if (std::none_of(out.begin(), out.end(), [&](const candidate& c) { return c.text == more.text; })) {
        out.push_back(std::move(more));
    }
}

// From an answer to PULL self:cles.
void add_nouns(std::vector<candidate>& out, const std::string& node, cles::verb verb, std::string_view description) {
    const auto document = parse_json(description);
    for (const auto& offered : offered_tasks(document.find("tasks"))) {
        if (offered.verb == to_string(verb)) {
            add_once(out, {node + ":" + offered.task + (offered.has_parameters ? "/" : ""), offered.description});
        }
    }
}

// The tasks that every node has.
void add_reserved(std::vector<candidate>& out, const std::string& node) {
    add_once(out, {node + ":cles", "Describes the node and what it offers"});
    add_once(out, {node + ":cles/metrics", "Its counters"});
    add_once(out, {node + ":cles/peers", "The nodes that it knows"});
}

asio::awaitable<std::vector<std::string>> descriptions(client& requester, const address_book& addresses,
                                                       std::string node, steady::time_point until) {
    std::vector<std::string> out;
    if (node != "any" && node != "all") {
        const auto noun = node + ":cles";
        const auto options = requester.options_for(noun, time_left(until));
        try {
            const cles::json_text answer = co_await requester.node().async_pull(noun, options);
            out.push_back(answer.text);
        } catch (const cles::error&) {
            out.clear(); // it does not answer in time
        }
        co_return out;
    }
    const auto nodes = co_await find_nodes_quickly(requester, addresses, until);
    std::vector<std::string> urls;
    for (const auto& one : nodes) {
        if (urls.size() < max_described && !one.endpoints.empty()) {
            urls.push_back(one.endpoints.front());
        }
    }
    auto answers = co_await ask_all(requester, "self:cles", std::move(urls), time_left(until));
    for (auto& answer : answers) {
        if (answer.error.empty()) {
            out.push_back(std::move(answer.json));
        }
    }
    co_return out;
}

} // namespace

asio::awaitable<std::vector<candidate>> live_names(client& requester, const address_book& addresses,
                                                   steady::time_point until) {
    const auto nodes = co_await find_nodes_quickly(requester, addresses, until);
    std::vector<candidate> out;
    for (const auto& node : nodes) {
        const auto url = node.url();
        add_once(out, {node.node, node.state == "live" || node.state.empty() ? url : node.state});
    }
    std::sort(out.begin(), out.end(), [](const candidate& a, const candidate& b) { return a.text < b.text; });
    co_return out;
}

asio::awaitable<std::vector<candidate>> live_urls(client& requester, const address_book& addresses,
                                                  steady::time_point until) {
    const auto nodes = co_await find_nodes_quickly(requester, addresses, until);
    std::vector<candidate> out;
    for (const auto& node : nodes) {
        for (const auto& url : node.endpoints) {
            add_once(out, {url, node.node});
        }
    }
    co_return out;
}

asio::awaitable<std::vector<candidate>> live_nouns(client& requester, const address_book& addresses, std::string node,
                                                   cles::verb verb, steady::time_point until) {
    const auto found = co_await descriptions(requester, addresses, node, until);
    std::vector<candidate> out;
    for (const auto& description : found) {
        try {
            add_nouns(out, node, verb, description);
        } catch (const cles::error&) {
            continue; // it is not JSON
        }
    }
    if (verb == cles::verb::pull && !found.empty()) {
        add_reserved(out, node);
    }
    co_return out;
}

asio::awaitable<std::vector<candidate>> live_bodies(client& requester, std::string noun, cles::verb verb,
                                                    steady::time_point until) {
    std::vector<candidate> out;
    const auto options = requester.options_for(noun, time_left(until));
    const std::vector<std::string> no_routers;
    try {
        const std::string answer = co_await ask_for_types(requester, noun, options, no_routers);
        auto example = example_body(read_told_types(answer), verb);
        if (!example.empty()) {
            out.push_back({std::move(example), "an example"});
        }
    } catch (const cles::error&) {
        out.clear(); // it tells none, or does not answer in time
    }
    co_return out;
}

} // namespace tool
