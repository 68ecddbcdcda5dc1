// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

#include "discovery/ask_all.hpp"
#include "discovery/listed_node.hpp"
#include "doctor/checks.hpp"
#include "output/statistics.hpp"

#include <boost/describe.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;

namespace {

struct stated_pool {
    std::string pool;
    std::string state;
};
BOOST_DESCRIBE_STRUCT(stated_pool, (), (pool, state))

struct stated_bridge {
    std::string pool;
    bool connected = false;
    std::optional<std::string> problem;
    std::optional<bool> member; // of a fleet that is secured
    std::optional<std::vector<std::string>> not_permitted;
    std::vector<stated_pool> pools;
    std::optional<std::uint64_t> round_trip_us;
};
BOOST_DESCRIBE_STRUCT(stated_bridge, (), (pool, connected, problem, member, not_permitted, pools, round_trip_us))

struct stated_metrics {
    std::optional<stated_bridge> federation; // only of bridges
};
BOOST_DESCRIBE_STRUCT(stated_metrics, (), (federation))

void check_bridge(const std::string& node, const stated_bridge& bridge, findings& found) {
    if (!bridge.connected) {
        found.failure(
            "federation", node + " is not connected to NATS" + (bridge.problem ? ": " + *bridge.problem : ""),
            "check that the server of federation.nats in its configuration runs and is reachable, and the files "
            "credentials, token and tls");
        return;
    }
    if (bridge.member == false) {
        found.failure("federation", node + " is not in the roster of its fleet, so it can seal nothing for other pools",
                      "add it with cles fleet add, and bring it the roster");
        return;
    }
    for (const auto& member : bridge.not_permitted.value_or(std::vector<std::string>{})) {
        std::string text = node;
        text.append(" has dropped what ")
            .append(member)
            .append(" sent through NATS: it may not forward for ")
            .append(node);
        std::string advice = "add ";
        advice.append(node).append(" to what ").append(member).append(" may forward for (cles fleet rights ");
        found.warning("federation", text, advice.append(member).append(" --forwards LIST, or '*')"));
    }
    if (bridge.problem) {
        found.warning("federation", "NATS refuses a part of what " + node + " does: " + *bridge.problem,
                      "permit its user the subjects of its pool (docs/federation.md, Security)");
    }
    if (!bridge.round_trip_us) {
        found.warning("federation", node + " is connected to NATS, but does not receive its own heartbeats",
                      "permit its user to publish cles." + bridge.pool + ".beat.*, and to subscribe to cles.*.beat.*");
        return;
    }
    std::string lost;
    for (const auto& pool : bridge.pools) {
        if (pool.state != "live") {
            lost.append(lost.empty() ? "" : ", ").append(pool.pool);
        }
    }
    constexpr double us_per_ms = 1e3;
    found.ok("federation", node + " reaches NATS and " + std::to_string(bridge.pools.size()) +
                               (bridge.pools.size() == 1 ? " other pool; " : " other pools; ") + "a message takes " +
                               fixed(static_cast<double>(*bridge.round_trip_us) / us_per_ms, 2) + " ms there and back");
    if (!lost.empty()) {
        found.warning("federation", node + " cannot reach any bridge of: " + lost,
                      "run cles doctor there: the bridge has ended, or is not connected to the same NATS");
    }
}

void check_bridge_of(const std::string& node, const node_answer& answer, findings& found) {
    stated_metrics stated;
    if (answer.error.empty() && cles::from_json(answer.json, stated) && stated.federation) {
        check_bridge(node, *stated.federation, found);
    }
}

} // namespace

asio::awaitable<void> check_federation(client& requester, const std::vector<listed_node>& nodes, findings& found) {
    auto urls = urls_of(nodes);
    const auto answers = co_await ask_all(requester, "self:cles/metrics", std::move(urls), query_timeout);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        check_bridge_of(nodes[i].node, answers[i], found);
    }
}

} // namespace tool
