// SPDX-License-Identifier: BSL-1.0
#include "completion/live_candidates.hpp"

#include <cles/error.hpp>

#include "client/client.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/node_search.hpp"
#include "discovery/time_left.hpp"
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

constexpr std::size_t most_asked = 32; // so many nodes answer in time, and tell enough

void add_once(std::vector<candidate>& out, candidate more) {
    if (std::none_of(out.begin(), out.end(), [&](const candidate& c) { return c.text == more.text; })) {
        out.push_back(std::move(more));
    }
}

// From an answer to PULL self:cles.
void add_nouns(std::vector<candidate>& out, const std::string& node, cles::verb verb, std::string_view description) {
    const auto about = parse_json(description);
    const auto* tasks = about.find("tasks");
    if (tasks == nullptr) {
        return;
    }
    for (const auto& entry : tasks->elements) {
        const auto* its_verb = entry.find("verb");
        const auto* task = entry.find("task");
        if (task != nullptr && its_verb != nullptr && its_verb->text == to_string(verb)) {
            const auto* parameters = entry.find("parameters");
            const auto* words = entry.find("description");
            const bool goes_on = parameters != nullptr && !parameters->elements.empty();
            add_once(out, {node + ":" + task->text + (goes_on ? "/" : ""), words != nullptr ? words->text : ""});
        }
    }
}

// What each node has of itself.
void add_reserved(std::vector<candidate>& out, const std::string& node) {
    add_once(out, {node + ":cles", "What it is and what it offers"});
    add_once(out, {node + ":cles/metrics", "What it has counted"});
    add_once(out, {node + ":cles/peers", "Whom it knows"});
}

asio::awaitable<std::vector<std::string>> descriptions(client& asker, const address_book& addresses, std::string node,
                                                       steady::time_point until) {
    std::vector<std::string> out;
    if (node != "any" && node != "all") {
        const auto noun = node + ":cles";
        const auto options = asker.options_for(noun, time_left(until));
        try {
            const cles::json_text answer = co_await asker.node().async_pull(noun, options);
            out.push_back(answer.text);
        } catch (const cles::error&) {
            out.clear(); // it is not there, or too slow
        }
        co_return out;
    }
    const auto nodes = co_await find_nodes_soon(asker, addresses, until);
    std::vector<std::string> urls;
    for (const auto& one : nodes) {
        if (urls.size() < most_asked && !one.endpoints.empty()) {
            urls.push_back(one.endpoints.front());
        }
    }
    auto answers = co_await ask_all(asker, "self:cles", std::move(urls), time_left(until));
    for (auto& answer : answers) {
        if (answer.error.empty()) {
            out.push_back(std::move(answer.json));
        }
    }
    co_return out;
}

} // namespace

asio::awaitable<std::vector<candidate>> live_names(client& asker, const address_book& addresses,
                                                   steady::time_point until) {
    const auto nodes = co_await find_nodes_soon(asker, addresses, until);
    std::vector<candidate> out;
    for (const auto& node : nodes) {
        const auto where = node.endpoints.empty() ? std::string{} : node.endpoints.front();
        add_once(out, {node.node, node.state == "live" || node.state.empty() ? where : node.state});
    }
    std::sort(out.begin(), out.end(), [](const candidate& a, const candidate& b) { return a.text < b.text; });
    co_return out;
}

asio::awaitable<std::vector<candidate>> live_urls(client& asker, const address_book& addresses,
                                                  steady::time_point until) {
    const auto nodes = co_await find_nodes_soon(asker, addresses, until);
    std::vector<candidate> out;
    for (const auto& node : nodes) {
        for (const auto& url : node.endpoints) {
            add_once(out, {url, node.node});
        }
    }
    co_return out;
}

asio::awaitable<std::vector<candidate>> live_nouns(client& asker, const address_book& addresses, std::string node,
                                                   cles::verb verb, steady::time_point until) {
    const auto told = co_await descriptions(asker, addresses, node, until);
    std::vector<candidate> out;
    for (const auto& description : told) {
        try {
            add_nouns(out, node, verb, description);
        } catch (const cles::error&) {
            continue; // it is not JSON
        }
    }
    if (verb == cles::verb::pull && !told.empty()) {
        add_reserved(out, node);
    }
    co_return out;
}

} // namespace tool
