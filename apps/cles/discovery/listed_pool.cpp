// SPDX-License-Identifier: BSL-1.0
#include "discovery/listed_pool.hpp"

#include <cles/json_writer.hpp>

#include "output/json_node.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

namespace tool {
namespace {

std::string text_at(const json_node& of, std::string_view name) {
    const auto* found = of.find(name);
    return found != nullptr ? found->text : std::string{};
}

// A scalar that is no string; empty for anything else.
std::string number_at(const json_node& of, std::string_view name) {
    const auto* found = of.find(name);
    return found != nullptr && found->kind == json_node::type::other ? found->text : std::string{};
}

void write_number(cles::json_writer& w, std::string_view name, const std::string& number) {
    w.key(name);
    w.raw(number.empty() ? "null" : number);
}

} // namespace

std::vector<listed_pool> pools_in(std::string_view node, const json_node& metrics) {
    std::vector<listed_pool> out;
    const auto* const federation = metrics.find("federation");
    if (federation == nullptr) {
        return out;
    }
    const bool connected = text_at(*federation, "connected") == "true";
    const auto* const pools = federation->find("pools");
    if (pools != nullptr) {
        for (const auto& each : pools->elements) {
            out.push_back({.bridge = std::string{node},
                           .pool = text_at(each, "pool"),
                           .state = connected ? text_at(each, "state") : "no NATS",
                           .bridges = number_at(each, "bridges"),
                           .nodes = number_at(each, "nodes")});
        }
    }
    if (out.empty()) {
        out.push_back({.bridge = std::string{node},
                       .pool = {},
                       .state = connected ? "no pools" : "no NATS",
                       .bridges = {},
                       .nodes = {}});
    }
    return out;
}

std::string pools_table(const std::vector<listed_pool>& pools) {
    table out{"BRIDGE", "POOL", "STATE", "BRIDGES", "NODES"};
    for (const auto& each : pools) {
        out.row();
        out.set(0, printable(each.bridge));
        out.set(1, each.pool.empty() ? "-" : printable(each.pool));
        out.set(2, printable(each.state));
        out.set(3, each.bridges.empty() ? "-" : printable(each.bridges), true);
        out.set(4, each.nodes.empty() ? "-" : printable(each.nodes), true);
    }
    return out.text();
}

std::string pools_json(const std::vector<listed_pool>& pools) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("pools");
    w.begin_array();
    for (const auto& each : pools) {
        w.begin_object();
        w.key("bridge");
        w.value(std::string_view{each.bridge});
        if (!each.pool.empty()) {
            w.key("pool");
            w.value(std::string_view{each.pool});
        }
        w.key("state");
        w.value(std::string_view{each.state});
        if (!each.pool.empty()) {
            write_number(w, "bridges", each.bridges);
            write_number(w, "nodes", each.nodes);
        }
        w.end_object();
    }
    w.end_array();
    w.end_object();
    return out;
}

} // namespace tool
