// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "client/client.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "doctor/checks.hpp"
#include "output/statistics.hpp"

#include <boost/describe.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
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

constexpr auto announcement_time = 400ms; // until all nodes have announced themselves, with some reserve
constexpr double max_offset_s = 0.1;

struct protocol_version {
    int protocol = 1;
};
BOOST_DESCRIBE_STRUCT(protocol_version, (), (protocol))

struct time_of_day {
    double seconds = 0;
};
BOOST_DESCRIBE_STRUCT(time_of_day, (), (seconds))

void check_node(const listed_node& node, const node_answer& answer, findings& found) {
    if (node.state == "clash") {
        return; // reported by check_names
    }
    if (node.endpoints.empty()) {
        found.warning("nodes", node.node + " does not listen at an address that is reachable from this host",
                      "let it listen at an address of its network: --listen tcp://0.0.0.0 --insecure");
    } else if (!answer.error.empty()) {
        found.failure("nodes",
                      node.node + " announces itself, but does not reply at " + node.url() + ": " + answer.error,
                      "check that it runs, and that no firewall on its host blocks the port");
    } else if (node.state == "suspect") {
        found.warning("nodes", node.node + " replies, but its announcements are no longer received",
                      "multicast is lost on the way: IGMP snooping without a querier, or Wi-Fi");
    }
}

void check_protocol(const listed_node& node, const std::string& description, findings& found) {
    try {
        const auto version = cles::from_json<protocol_version>(description).protocol;
        if (version != 1) {
            found.warning("nodes", node.node + " uses version " + std::to_string(version) + " of the protocol, not 1");
        }
    } catch (const cles::error&) {
        found.failure("nodes", "the reply of " + node.node + " does not describe a node",
                      "check that " + node.url() + " is a CLES node");
    }
}

struct stated_roster {
    std::uint32_t roster = 0; // none without security
};
BOOST_DESCRIBE_STRUCT(stated_roster, (), (roster))

// Nodes give a newer roster to each other, so versions differ for seconds only, unless a node is out of reach.
void check_rosters(const std::vector<listed_node>& nodes, const std::vector<node_answer>& answers, findings& found) {
    std::string versions;
    std::set<std::uint32_t> different;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        try {
            const auto version = answers[i].error.empty() ? cles::from_json<stated_roster>(answers[i].json).roster : 0U;
            if (version != 0) {
                versions.append(versions.empty() ? "" : ", ").append(nodes[i].node).append(" has ");
                versions.append(std::to_string(version));
                different.insert(version);
            }
        } catch (const cles::error&) {
            continue; // check_protocol reports it
        }
    }
    if (different.size() > 1) {
        found.warning("nodes", "the versions of the roster differ: " + versions,
                      "if they still do after some seconds, carry the newest to the others: cles pull NODE:cles/roster "
                      ">roster, and there cles keys join roster");
    } else if (!different.empty()) {
        found.ok("nodes", "version " + std::to_string(*different.begin()) + " of the roster is in force");
    }
}

struct isolated_plugin {
    std::string name;
    std::string state;
};
BOOST_DESCRIBE_STRUCT(isolated_plugin, (), (name, state))

struct stated_plugins {
    std::optional<std::vector<isolated_plugin>> isolated; // only of daemons that have some
};
BOOST_DESCRIBE_STRUCT(stated_plugins, (), (isolated))

// Plugins whose processes have ended so often that the daemon does not start them again.
asio::awaitable<void> check_plugins(client& requester, const std::vector<listed_node>& nodes, findings& found) {
    auto urls = urls_of(nodes);
    const auto answers = co_await ask_all(requester, "self:cles/metrics", std::move(urls), query_timeout);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        stated_plugins stated;
        if (!answers[i].error.empty() || !cles::from_json(answers[i].json, stated)) {
            continue; // it may not be allowed
        }
        for (const auto& plugin : stated.isolated.value_or(std::vector<isolated_plugin>{})) {
            if (plugin.state == "withdrawn") {
                found.warning("nodes",
                              "the tasks of the plugin " + plugin.name + " of " + nodes[i].node +
                                  " are withdrawn, because its process ended too often",
                              "the log of " + nodes[i].node + " says why; SIGHUP starts it again");
            }
        }
    }
}

// Either of the two lists only the other one, so it does not show which was first.
void note_conflicts(const std::vector<listed_node>& listed, std::map<std::string, std::string>& conflicts) {
    for (const auto& node : listed) {
        if (node.state != "clash") {
            continue;
        }
        auto& places = conflicts[node.node];
        const auto first = std::ranges::find_if(listed, [&](const listed_node& other) {
            return other.node == node.node && other.state != "clash" && !other.endpoints.empty();
        });
        if (first != listed.end() && places.empty()) {
            places = "the one at " + first->url() + " gets its requests, the second one" +
                     (node.endpoints.empty() ? "" : ", at " + node.url() + ",") + " none";
        }
    }
}

// The nodes know of a name conflict sooner than this command, which has just started.
asio::awaitable<void> check_names(client& requester, const std::vector<listed_node>& nodes, findings& found) {
    auto urls = urls_of(nodes);
    const auto answers = co_await ask_all(requester, "self:cles/peers", std::move(urls), query_timeout);
    std::map<std::string, std::string> conflicts; // by name: where the two are, if that is known
    note_conflicts(nodes, conflicts);
    for (const auto& answer : answers) {
        try {
            note_conflicts(answer.error.empty() ? peers_in(answer.json) : std::vector<listed_node>{}, conflicts);
        } catch (const cles::error&) {
            continue; // check_protocol reports it
        }
    }
    for (const auto& [name, places] : conflicts) {
        found.failure("nodes",
                      "two nodes have the name " + name +
                          (places.empty() ? "; the second one gets no requests" : ": " + places),
                      "give each a unique name: --name of cles serve, node in clesd.yaml");
    }
}

// Compares the clocks of nodes that offer `utc` with this host's, up to half the time that the request takes.
asio::awaitable<void> compare_clocks(client& requester, const std::vector<listed_node>& nodes, findings& found) {
    for (const auto& node : nodes) {
        if (node.endpoints.empty() || !node.offers("pull:utc")) {
            continue;
        }
        std::vector<std::string> url{node.url()};
        const auto before = std::chrono::system_clock::now();
        const auto answers = co_await ask_all(requester, "self:utc", std::move(url), query_timeout);
        const auto after = std::chrono::system_clock::now();
        double seconds = 0;
        try {
            seconds = cles::from_json<time_of_day>(answers.front().json).seconds;
        } catch (const cles::error&) {
            continue; // another task of that name
        }
        const auto duration = std::chrono::duration<double>{after - before}.count();
        const auto middle = std::chrono::duration<double>{before.time_since_epoch()}.count() + duration / 2;
        const auto offset = seconds - middle;
        if (std::abs(offset) > max_offset_s + duration / 2) {
            found.warning("clock",
                          "the clock of " + node.node + " is " + fixed(std::abs(offset), 3) + " s " +
                              (offset > 0 ? "ahead of" : "behind") + " that of this host",
                          "synchronise both if their times are compared");
        }
    }
}

std::string count_text(std::size_t nodes) {
    return nodes == 0 ? "no nodes found" : nodes == 1 ? "1 node found" : std::to_string(nodes) + " nodes found";
}

} // namespace

asio::awaitable<void> check_nodes(client& requester, const address_book& addresses, findings& found) {
    if (!addresses.finds_by_name() && !addresses.has_url()) {
        found.ok("nodes", "no nodes are found without multicast; --at URL asks a node for those that it knows");
        co_return;
    }
    std::vector<listed_node> nodes;
    try {
        const auto limit = std::chrono::milliseconds{query_timeout};
        auto all = co_await find_nodes(requester, addresses, steady::now() + announcement_time, limit);
        nodes = std::move(all);
    } catch (const cles::error&) {
        co_return; // check_ports reports it
    }
    auto urls = urls_of(nodes);
    const auto answers = co_await ask_all(requester, "self:cles", std::move(urls), query_timeout);
    found.ok("nodes", count_text(nodes.size()));
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        check_node(nodes[i], answers[i], found);
        if (answers[i].error.empty()) {
            nodes[i].read_tasks(answers[i].json);
            check_protocol(nodes[i], answers[i].json, found);
        }
    }
    if (addresses.is_secured()) {
        check_rosters(nodes, answers, found);
    }
    co_await check_names(requester, nodes, found);
    co_await check_plugins(requester, nodes, found);
    co_await check_federation(requester, nodes, found);
    co_await compare_clocks(requester, nodes, found);
}

} // namespace tool
