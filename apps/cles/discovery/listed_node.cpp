// SPDX-License-Identifier: BSL-1.0
#include "discovery/listed_node.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/verb.hpp>

#include "options/duration.hpp"
#include "output/json_node.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <boost/describe.hpp>

#include <algorithm>
#include <chrono>
#include <iterator>
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
    std::optional<told_load> load;
};
BOOST_DESCRIBE_STRUCT(told_self, (), (node, epoch, endpoints, load))

cles::node_load load_of(const told_load& load) { return {load.queued, load.running, load.workers}; }

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
    if (node.load) {
        w.key("load");
        write_load(w, *node.load);
    }
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

bool listed_node::offers(std::string_view task) const {
    const auto colon = task.find(':');
    const auto verb = cles::verb_from(task.substr(0, colon == std::string_view::npos ? 0 : colon));
    task.remove_prefix(colon == std::string_view::npos ? 0 : colon + 1);
    if (tasks.empty()) {
        return false;
    }
    const auto all = parse_json(tasks);
    return std::any_of(all.elements.begin(), all.elements.end(), [&](const json_node& entry) {
        const auto* its_verb = entry.find("verb");
        const auto* its_name = entry.find("task");
        return its_name != nullptr && its_name->text == task &&
               (!verb || (its_verb != nullptr && its_verb->text == to_string(*verb)));
    });
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
    if (self.load) {
        nodes.front().load = load_of(*self.load);
    }
    auto known = listed_others(others);
    nodes.insert(nodes.end(), std::make_move_iterator(known.begin()), std::make_move_iterator(known.end()));
    return nodes;
}

std::vector<listed_node> listed_others(std::string_view others) {
    std::vector<listed_node> nodes;
    for (const auto& p : cles::from_json<told_peers>(others).peers) {
        nodes.push_back({.node = p.node,
                         .state = p.state,
                         .age_ms = p.age_ms,
                         .endpoints = p.endpoints,
                         .epoch = p.epoch,
                         .load = load_of(p.load)});
    }
    return nodes;
}

void write_load(cles::json_writer& w, const cles::node_load& load) {
    cles::write_json(w, told_load{load.queued, load.running, load.workers});
}

std::string to_text(const std::optional<cles::node_load>& load) {
    if (!load) {
        return "-";
    }
    std::string out = std::to_string(load->running);
    if (load->workers != 0) {
        out.append("/").append(std::to_string(load->workers));
    }
    if (load->queued != 0) {
        out.append(" +").append(std::to_string(load->queued));
    }
    return out;
}

std::string to_table(const std::vector<listed_node>& nodes, bool tasks) {
    table out;
    std::vector<const char*> titles{"NODE", "STATE", "LOAD", "HEARD", "ENDPOINTS"};
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
        out.set(2, to_text(node.load), true);
        out.set(3, node.age_ms ? to_text(std::chrono::milliseconds{*node.age_ms}) + " ago" : "now");
        out.set(4, node.endpoints.empty() ? "-" : joined(node.endpoints));
        if (tasks) {
            out.set(5, node.tasks.empty() ? "(" + printable(node.error) + ")" : tasks_in_words(node.tasks));
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
