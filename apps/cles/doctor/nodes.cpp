// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "client/client.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/node_search.hpp"
#include "doctor/checks.hpp"
#include "output/statistics.hpp"

#include <boost/describe.hpp>

#include <chrono>
#include <cmath>
#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr auto patience = 1s;
constexpr auto listening = 400ms; // a round of asking, and a little
constexpr double most_apart_s = 0.1;

struct spoken {
    int protocol = 1;
};
BOOST_DESCRIBE_STRUCT(spoken, (), (protocol))

struct time_of_day {
    double seconds = 0;
};
BOOST_DESCRIBE_STRUCT(time_of_day, (), (seconds))

std::string where(const listed_node& node) { return node.endpoints.empty() ? "no address" : node.endpoints.front(); }

void judge(const listed_node& node, const node_answer& answer, findings& found) {
    if (node.state == "clash") {
        return; // told of its name
    }
    if (node.endpoints.empty()) {
        found.push_back({"nodes", verdict::warning, node.node + " listens where it cannot be asked from here",
                         "let it listen at an address of its network: --listen tcp://0.0.0.0 --insecure"});
    } else if (!answer.error.empty()) {
        found.push_back({"nodes", verdict::failure,
                         node.node + " announces itself, and does not answer at " + where(node) + ": " + answer.error,
                         "does a firewall on its host drop that port? Does it still run?"});
    } else if (node.state == "suspect") {
        found.push_back({"nodes", verdict::warning, node.node + " answers, and is not heard any more",
                         "multicast is lost on the way: IGMP snooping without a querier, or Wi-Fi"});
    }
}

void judge_protocol(const listed_node& node, const std::string& description, findings& found) {
    try {
        const auto version = cles::from_json<spoken>(description).protocol;
        if (version != 1) {
            found.push_back({"nodes", verdict::warning,
                             node.node + " speaks version " + std::to_string(version) + " of the protocol, not 1"});
        }
    } catch (const cles::error&) {
        found.push_back({"nodes", verdict::failure, "what " + node.node + " says of itself is no description of a node",
                         "is " + where(node) + " a CLES node?"});
    }
}

// Nodes hear of a clash sooner than who has just come.
asio::awaitable<void> look_for_clashes(client& asker, const std::vector<listed_node>& nodes,
                                       std::vector<std::string> urls, findings& found) {
    const auto answers = co_await ask_all(asker, "self:cles/peers", std::move(urls), patience);
    auto all = nodes;
    for (const auto& answer : answers) {
        try {
            const auto told = answer.error.empty() ? listed_others(answer.json) : std::vector<listed_node>{};
            all.insert(all.end(), told.begin(), told.end());
        } catch (const cles::error&) {
            continue; // what it says of itself has been judged
        }
    }
    std::set<std::string> names;
    for (const auto& node : all) {
        if (node.state == "clash" && names.insert(node.node).second) {
            found.push_back({"nodes", verdict::failure, "two nodes call themselves " + node.node + "; one is not asked",
                             "give each a name of its own: --name of cles serve, node in clesd.yaml"});
        }
    }
}

// Of those who tell their time, whether it is this host's. Half of what it takes to ask is what cannot be known.
asio::awaitable<void> compare_clocks(client& asker, const std::vector<listed_node>& nodes, findings& found) {
    for (const auto& node : nodes) {
        if (node.endpoints.empty() || !node.offers("pull:utc")) {
            continue;
        }
        std::vector<std::string> url{node.endpoints.front()};
        const auto before = std::chrono::system_clock::now();
        const auto answers = co_await ask_all(asker, "self:utc", std::move(url), patience);
        const auto after = std::chrono::system_clock::now();
        std::optional<double> theirs;
        try {
            theirs = cles::from_json<time_of_day>(answers.front().json).seconds;
        } catch (const cles::error&) {
            continue; // a task of that name which means something else
        }
        const auto took = std::chrono::duration<double>{after - before}.count();
        const auto middle = std::chrono::duration<double>{before.time_since_epoch()}.count() + took / 2;
        const auto apart = *theirs - middle;
        if (std::abs(apart) > most_apart_s + took / 2) {
            found.push_back({"clock", verdict::warning,
                             node.node + " is " + fixed(std::abs(apart), 3) + " s " +
                                 (apart > 0 ? "ahead of" : "behind") + " this host",
                             "synchronise both where their times are compared"});
        }
    }
}

std::string counted(std::size_t nodes) {
    return nodes == 0 ? "nobody is heard" : nodes == 1 ? "one is heard" : std::to_string(nodes) + " are heard";
}

} // namespace

asio::awaitable<void> check_nodes(client& asker, const address_book& addresses, findings& found) {
    if (!addresses.finds_by_name() && !addresses.has_url()) {
        found.push_back(
            {"nodes", verdict::ok, "without multicast nobody is heard; --at URL asks a node whom it knows"});
        co_return;
    }
    std::vector<listed_node> nodes;
    try {
        const auto limit = std::chrono::milliseconds{patience};
        auto heard = co_await find_nodes(asker, addresses, steady::now() + listening, limit);
        nodes = std::move(heard);
    } catch (const cles::error&) {
        co_return; // the ports have told
    }
    std::vector<std::string> urls;
    urls.reserve(nodes.size());
    for (const auto& node : nodes) {
        urls.push_back(node.endpoints.empty() ? "" : node.endpoints.front());
    }
    const auto answers = co_await ask_all(asker, "self:cles", urls, patience);
    found.push_back({"nodes", verdict::ok, counted(nodes.size())});
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        judge(nodes[i], answers[i], found);
        if (answers[i].error.empty()) {
            nodes[i].learn(answers[i].json);
            judge_protocol(nodes[i], answers[i].json, found);
        }
    }
    co_await look_for_clashes(asker, nodes, std::move(urls), found);
    co_await compare_clocks(asker, nodes, found);
}

} // namespace tool
