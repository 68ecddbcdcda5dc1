// SPDX-License-Identifier: BSL-1.0
#include "discovery/listed_node.hpp"

#include <cles/convert.hpp>
#include <cles/json_reader.hpp>
#include <cles/verb.hpp>

#include "client/offered_tasks.hpp"
#include "discovery/stated_endpoints.hpp"
#include "options/duration.hpp"
#include "output/json_node.hpp"

#include <boost/describe.hpp>

#include <algorithm>
#include <chrono>
#include <iterator>

namespace tool {
namespace {

struct load_document {
    std::uint32_t queued = 0;
    std::uint32_t running = 0;
    std::uint32_t workers = 0;

    [[nodiscard]] cles::node_load value() const { return {queued, running, workers}; }
};
BOOST_DESCRIBE_STRUCT(load_document, (), (queued, running, workers))

struct peer_document {
    std::string node;
    std::vector<std::string> endpoints;
    std::string epoch;
    std::int64_t age_ms = 0;
    std::string state;
    load_document load;
    std::optional<std::uint32_t> hops;
    std::optional<std::string> via;
};
BOOST_DESCRIBE_STRUCT(peer_document, (), (node, endpoints, epoch, age_ms, state, load, hops, via))

struct peers_document {
    std::vector<peer_document> peers;
};
BOOST_DESCRIBE_STRUCT(peers_document, (), (peers))

struct self_document {
    std::string node;
    std::string epoch;
    std::vector<std::string> endpoints;
    std::optional<load_document> load;
    std::optional<std::string> pool;
};
BOOST_DESCRIBE_STRUCT(self_document, (), (node, epoch, endpoints, load, pool))

} // namespace

std::string listed_node::route() const {
    return hops == 1 ? "-" : hops == 0 ? "none" : std::to_string(hops) + " links via " + via;
}

std::string listed_node::last_seen() const {
    return age_ms ? to_text(std::chrono::milliseconds{*age_ms}) + " ago" : "now";
}

void listed_node::read_tasks(std::string_view description) {
    cles::json_reader reader{description};
    std::string_view key;
    std::string_view found;
    if (reader.begin_object()) {
        while (reader.next_key(key)) {
            if (key == "tasks" ? !reader.read_raw(found) : !reader.skip()) {
                break;
            }
        }
    }
    if (!reader.ok() || !found.starts_with('[')) {
        error = "its reply contains no tasks";
        return;
    }
    tasks.clear();
    cles::append_compact_json(found, tasks);
}

bool listed_node::offers(std::string_view task) const {
    if (tasks.empty()) {
        return false;
    }
    const auto colon = task.find(':');
    const auto verb = cles::verb_from(task.substr(0, colon == std::string_view::npos ? 0 : colon));
    task.remove_prefix(colon == std::string_view::npos ? 0 : colon + 1);
    const auto list = parse_json(tasks);
    const auto all = offered_tasks(&list);
    return std::any_of(all.begin(), all.end(), [&](const offered_task& offered) {
        return offered.task == task && (!verb || offered.verb == to_string(*verb));
    });
}

std::vector<listed_node> nodes_of(const std::vector<cles::peer>& peers) {
    std::vector<listed_node> nodes;
    nodes.reserve(peers.size());
    for (const auto& p : peers) {
        nodes.push_back({.node = p.node,
                         .state = std::string{to_string(p.state)},
                         .age_ms = p.age.count(),
                         .endpoints = p.endpoints,
                         .epoch = p.epoch,
                         .load = p.load,
                         .hops = p.hops,
                         .via = p.via});
    }
    return nodes;
}

std::vector<listed_node> nodes_of(std::string_view asked, std::string_view self, std::string_view peers) {
    const auto document = cles::from_json<self_document>(self);
    std::vector<listed_node> nodes{{.node = document.node,
                                    .state = "live",
                                    .age_ms = {},
                                    .endpoints = endpoints_from_here(asked, document.endpoints),
                                    .epoch = document.epoch}};
    if (document.load) {
        nodes.front().load = document.load->value();
    }
    auto known = peers_in(asked, peers);
    nodes.insert(nodes.end(), std::make_move_iterator(known.begin()), std::make_move_iterator(known.end()));
    for (auto& node : nodes) { // it knows those of its own pool only
        node.pool = document.pool.value_or("");
    }
    return nodes;
}

std::vector<listed_node> peers_in(std::string_view asked, std::string_view peers) {
    std::vector<listed_node> nodes;
    for (const auto& p : cles::from_json<peers_document>(peers).peers) {
        nodes.push_back({.node = p.node,
                         .state = p.state,
                         .age_ms = p.age_ms,
                         .endpoints = known_endpoints_from_here(asked, p.endpoints),
                         .epoch = p.epoch,
                         .load = p.load.value(),
                         .hops = p.hops.value_or(1),
                         .via = p.via.value_or("")});
    }
    return nodes;
}

std::vector<std::string> urls_of(const std::vector<listed_node>& nodes) {
    std::vector<std::string> urls;
    urls.reserve(nodes.size());
    for (const auto& node : nodes) {
        urls.push_back(node.url());
    }
    return urls;
}

void write_load(cles::json_writer& w, const cles::node_load& load) {
    cles::write_json(w, load_document{load.queued, load.running, load.workers});
}

} // namespace tool
