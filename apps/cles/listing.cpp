// SPDX-License-Identifier: BSL-1.0
#include "listing.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "duration.hpp"
#include "json_node.hpp"
#include "table.hpp"
#include "terminal.hpp"

#include <boost/describe.hpp>

#include <chrono>
#include <utility>

namespace tool {
namespace {

struct told_load {
    std::uint32_t queued = 0;
    std::uint32_t running = 0;
    std::uint32_t workers = 0;
};
BOOST_DESCRIBE_STRUCT(told_load, (), (queued, running, workers))

struct told_peer {
    std::string node;
    std::vector<std::string> endpoints;
    std::string epoch;
    std::int64_t age_ms = 0;
    std::string state;
    told_load load;
};
BOOST_DESCRIBE_STRUCT(told_peer, (), (node, endpoints, epoch, age_ms, state, load))

struct told_peers {
    std::vector<told_peer> peers;
};
BOOST_DESCRIBE_STRUCT(told_peers, (), (peers))

struct told_self {
    std::string node;
    std::string epoch;
    std::vector<std::string> endpoints;
};
BOOST_DESCRIBE_STRUCT(told_self, (), (node, epoch, endpoints))

std::string joined(const std::vector<std::string>& parts) {
    std::string out;
    for (const auto& part : parts) {
        out.append(out.empty() ? "" : " ").append(printable(part));
    }
    return out;
}

// "localization (PULL BIND)" for each, in the order in which they came.
std::string tasks_in_words(std::string_view json) {
    std::vector<std::pair<std::string, std::string>> verbs_of;
    for (const auto& entry : parse_json(json).elements) {
        const auto* verb = entry.find("verb");
        const auto* task = entry.find("task");
        if (verb == nullptr || task == nullptr) {
            continue;
        }
        if (verbs_of.empty() || verbs_of.back().first != task->text) {
            verbs_of.emplace_back(task->text, "");
        }
        auto& verbs = verbs_of.back().second;
        verbs.append(verbs.empty() ? "" : " ").append(verb->text);
    }
    std::string out;
    for (const auto& [task, verbs] : verbs_of) {
        out.append(out.empty() ? "" : ", ").append(printable(task)).append(" (").append(printable(verbs)).append(")");
    }
    return out;
}

void write_node(cles::json_writer& w, const listed_node& node, bool tasks) {
    w.begin_object();
    w.key("node");
    w.value(std::string_view{node.node});
    w.key("endpoints");
    w.begin_array();
    for (const auto& endpoint : node.endpoints) {
        w.value(std::string_view{endpoint});
    }
    w.end_array();
    w.key("epoch");
    w.value(std::string_view{node.epoch});
    w.key("age_ms");
    w.value(node.age_ms.value_or(0));
    w.key("state");
    w.value(std::string_view{node.state});
    w.key("load");
    cles::write_json(w, told_load{node.load.queued, node.load.running, node.load.workers});
    if (tasks && node.tasks.empty()) {
        w.key("failure");
        w.value(std::string_view{node.error});
    } else if (tasks) {
        w.key("tasks");
        w.raw(node.tasks);
    }
    w.end_object();
}

} // namespace

void listed_node::learn(std::string_view description) {
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
        error = "its answer names no tasks";
        return;
    }
    tasks.clear();
    cles::append_compact_json(found, tasks);
}

std::vector<listed_node> listed(const std::vector<cles::peer>& peers) {
    std::vector<listed_node> nodes;
    nodes.reserve(peers.size());
    for (const auto& p : peers) {
        nodes.push_back({.node = p.node,
                         .state = std::string{to_string(p.state)},
                         .age_ms = p.age.count(),
                         .endpoints = p.endpoints,
                         .epoch = p.epoch,
                         .load = p.load});
    }
    return nodes;
}

std::vector<listed_node> listed(std::string_view itself, std::string_view others) {
    const auto self = cles::from_json<told_self>(itself);
    std::vector<listed_node> nodes{
        {.node = self.node, .state = "live", .age_ms = {}, .endpoints = self.endpoints, .epoch = self.epoch}};
    for (const auto& p : cles::from_json<told_peers>(others).peers) {
        nodes.push_back({.node = p.node,
                         .state = p.state,
                         .age_ms = p.age_ms,
                         .endpoints = p.endpoints,
                         .epoch = p.epoch,
                         .load = {p.load.queued, p.load.running, p.load.workers}});
    }
    return nodes;
}

std::string to_table(const std::vector<listed_node>& nodes, bool tasks) {
    table out;
    std::vector<const char*> titles{"NODE", "STATE", "HEARD", "ENDPOINTS"};
    if (tasks) {
        titles.push_back("TASKS");
    }
    for (const char* title : titles) {
        out.column(title);
    }
    for (const auto& node : nodes) {
        out.row();
        out.set(0, printable(node.node));
        out.set(1, printable(node.state));
        out.set(2, node.age_ms ? to_text(std::chrono::milliseconds{*node.age_ms}) + " ago" : "now");
        out.set(3, node.endpoints.empty() ? "-" : joined(node.endpoints));
        if (tasks) {
            out.set(4, node.tasks.empty() ? "(" + printable(node.error) + ")" : tasks_in_words(node.tasks));
        }
    }
    return out.text();
}

std::string to_json(const std::vector<listed_node>& nodes, bool tasks) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("peers");
    w.begin_array();
    for (const auto& node : nodes) {
        write_node(w, node, tasks);
    }
    w.end_array();
    w.end_object();
    return out;
}

} // namespace tool
