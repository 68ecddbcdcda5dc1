// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "client/client.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "discovery/host.hpp"
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

constexpr auto announcement_time = 400ms;      // until all nodes have announced themselves, with some reserve
constexpr auto announcement_interval = 1300ms; // until those have that were not asked, in networks of up to 100 nodes
constexpr double max_offset_s = 0.1;

struct protocol_version {
    int protocol = 0; // every node states it
};
BOOST_DESCRIBE_STRUCT(protocol_version, (), (protocol))

struct time_of_day {
    double seconds = 0;
};
BOOST_DESCRIBE_STRUCT(time_of_day, (), (seconds))

void check_node(const listed_node& node, const node_answer& answer, bool secured, findings& found) {
    if (node.state == "clash") {
        return; // reported by check_names
    }
    if (node.endpoints.empty()) {
        found.warning("nodes", node.node + " does not listen at an address that is reachable from this host",
                      secured ? "let it listen at an address of its network: --listen tls://0.0.0.0"
                              : "let it listen at an address of its network: --listen tcp://0.0.0.0 --insecure");
    } else if (answer.code == cles::errc::denied) { // which may be as it should be
        found.warning("nodes", node.node + " denies what nodes ask each other: " + answer.error,
                      secured ? advice_on_denial : "permit PULL 'cles' in its access rules");
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
        if (version == 1) {
            return;
        }
        if (version != 0) {
            found.failure("nodes", node.node + " uses version " + std::to_string(version) + " of the protocol, not 1",
                          "install the same version of CLES on both hosts");
            return;
        }
    } catch (const cles::error&) { // as without a version
    }
    found.failure("nodes", "the reply of " + node.node + " does not describe a node",
                  "check that " + node.url() + " is a CLES node");
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
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        try {
            note_conflicts(answers[i].error.empty() ? peers_in(nodes[i].url(), answers[i].json)
                                                    : std::vector<listed_node>{},
                           conflicts);
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
    return nodes == 1 ? "1 node found" : std::to_string(nodes) + " nodes found";
}

bool is_on_loopback_only(const cles::multicast_options& group) {
    const auto all = network_interfaces();
    return std::ranges::all_of(cles::interfaces_of(group), [&](const std::string& name) {
        const auto* const each = find_interface(all, name);
        return each != nullptr && each->loopback;
    });
}

// Nobody has announced itself. Whether that is as it should be depends on what was received instead.
asio::awaitable<void> report_none(client& requester, const address_book& addresses, const known_before& known,
                                  findings& found) {
    const auto heard = co_await count_heard(requester);
    const auto group = addresses.group();
    const auto on = " on " + joined(cles::interfaces_of(group));
    if (addresses.is_secured() && heard.group_unopened != 0) {
        found.failure(
            "nodes", "no nodes found" + on + ", but datagrams that this key cannot open",
            "they are of another fleet, or of another roster: compare the fleet and the roster that cles keys "
            "show prints for their directories and for this one");
    } else if (addresses.is_secured() && heard.datagrams_unsealed != 0) {
        found.failure("nodes", "no nodes found" + on + ", but datagrams that are not sealed",
                      "they are of nodes without security, which are found without --keys");
    } else if (heard.announcements_foreign != 0) {
        found.failure(
            "nodes", "no nodes found" + on + ", but announcements of nodes of other pools",
            "select with --pool or CLES_POOL the pool that --pool of cles serve, or pool in clesd.yaml, gives them");
    } else if (!addresses.is_secured() && heard.group_dropped != 0) {
        found.failure("nodes", "no nodes found" + on + ", but datagrams that cannot be read",
                      "if they are of nodes with security, give the key of a member of their fleet: --keys DIR");
    } else if (!known.at_port.empty()) {
        found.warning("nodes",
                      "no nodes found" + on + ": the node at " + known.at_port + " does not announce itself there",
                      "select its interfaces with --multicast or CLES_MULTICAST, or give it these (--multicast of cles "
                      "serve, multicast in clesd.yaml)");
    } else if (is_on_loopback_only(group)) {
        found.ok("nodes", "no nodes found");
    } else {
        found.warning("nodes", "no nodes found" + on,
                      "if there are some: both hosts need an interface in the same network, and UDP port " +
                          std::to_string(group.port) + " open; cles doctor --at URL checks one without multicast");
    }
}

// Those that do not receive this host, or cannot be read here, are only noticed by their next announcements.
asio::awaitable<std::vector<listed_node>> wait_for_nodes(client& requester, const address_book& addresses,
                                                         const known_before& known, findings& found) {
    const auto limit = std::chrono::milliseconds{query_timeout};
    auto nodes = co_await find_nodes(requester, addresses, steady::now() + announcement_time, limit);
    if (!nodes.empty() || !addresses.finds_by_name() || known.nobody_listens) {
        co_return nodes;
    }
    auto late = co_await find_nodes(requester, addresses, steady::now() + announcement_interval, limit);
    for (const auto& node : late) {
        if (!known.may_ask_group) { // so nobody has answered
            break;
        }
        found.failure("nodes", node.node + " is received, but does not receive what this host sends to the group",
                      "open incoming UDP port " + std::to_string(addresses.group().port) +
                          " in the firewall of its host, and outgoing in that of this one");
    }
    co_return late;
}

} // namespace

asio::awaitable<void> check_nodes(client& requester, const address_book& addresses, const known_before& known,
                                  findings& found) {
    if (!addresses.finds_by_name() && !addresses.has_url()) {
        found.ok("nodes", "no nodes are found without multicast; --at URL asks a node for those that it knows");
        co_return;
    }
    std::vector<listed_node> nodes;
    try {
        auto all = co_await wait_for_nodes(requester, addresses, known, found);
        nodes = std::move(all);
    } catch (const cles::error&) {
        co_return; // check_ports reports it
    }
    if (nodes.empty()) {
        co_await report_none(requester, addresses, known, found);
        co_return;
    }
    auto urls = urls_of(nodes);
    const auto answers = co_await ask_all(requester, "self:cles", std::move(urls), query_timeout);
    found.ok("nodes", count_text(nodes.size()));
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        check_node(nodes[i], answers[i], addresses.is_secured(), found);
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
