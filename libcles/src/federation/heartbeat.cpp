// SPDX-License-Identifier: BSL-1.0
#include "federation/heartbeat.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "federation/subject.hpp"
#include "protocol/fnv1a.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>

namespace cles::bridging {
namespace {

constexpr std::size_t max_depth = 8;
constexpr std::uint64_t min_interval = 100; // in milliseconds
constexpr std::uint64_t max_interval = 60'000;

std::uint64_t hash_of(const std::vector<std::string>& names) {
    auto hash = protocol::fnv1a_basis;
    for (const auto& name : names) {
        hash = protocol::fnv1a("\n", protocol::fnv1a(name, hash));
    }
    return hash;
}

} // namespace

std::string text_of(const heartbeat& said) {
    std::string text;
    json_writer w{text};
    w.begin_object();
    w.key("node");
    w.value(std::string_view{said.node});
    w.key("interval_ms");
    w.value(std::uint64_t(said.interval.count()));
    w.key("names");
    w.value(std::string_view{said.names});
    if (!said.replaces.empty()) {
        w.key("replaces");
        w.value(std::string_view{said.replaces});
    }
    for (const auto& [key, is_set] : {std::pair{"leaving", said.leaving}, std::pair{"starting", said.starting},
                                      std::pair{"closing", said.closing}}) {
        if (is_set) {
            w.key(key);
            w.value(true);
        }
    }
    if (said.roster != 0) {
        w.key("roster");
        w.value(std::uint64_t{said.roster});
    }
    w.end_object();
    return text;
}

std::optional<heartbeat> parse_heartbeat(std::string_view text) {
    heartbeat read;
    json_reader r{text, max_depth};
    std::string_view key;
    std::uint64_t interval = 0;
    std::uint64_t roster = 0;
    bool good = r.begin_object();
    while (good && r.next_key(key)) {
        good = key == "node"          ? r.read(read.node)
               : key == "interval_ms" ? r.read(interval)
               : key == "names"       ? r.read(read.names)
               : key == "replaces"    ? r.read(read.replaces)
               : key == "leaving"     ? r.read(read.leaving)
               : key == "starting"    ? r.read(read.starting)
               : key == "closing"     ? r.read(read.closing)
               : key == "roster"      ? r.read(roster)
                                      : r.skip();
    }
    if (!r.at_end() || !protocol::is_name(read.node) || !is_instance(read.names) ||
        !(read.replaces.empty() || is_instance(read.replaces)) || roster > std::numeric_limits<std::uint32_t>::max()) {
        return {};
    }
    read.roster = static_cast<std::uint32_t>(roster);
    read.interval = std::chrono::milliseconds{std::clamp(interval, min_interval, max_interval)};
    return read;
}

node_names names_of(std::vector<std::string> nodes) {
    std::ranges::sort(nodes);
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    const auto digest = hash_of(nodes);
    return {.digest = instance_text(digest), .nodes = std::move(nodes)};
}

std::string text_of(const node_names& said) {
    std::string text;
    json_writer w{text};
    w.begin_object();
    w.key("digest");
    w.value(std::string_view{said.digest});
    w.key("nodes");
    w.begin_array();
    for (const auto& node : said.nodes) {
        w.value(std::string_view{node});
    }
    w.end_array();
    w.end_object();
    return text;
}

std::optional<node_names> parse_names(std::string_view text, std::size_t most) {
    std::string digest;
    std::vector<std::string> nodes;
    json_reader r{text, max_depth};
    std::string_view key;
    bool good = r.begin_object();
    while (good && r.next_key(key)) {
        if (key == "digest") {
            good = r.read(digest);
        } else if (key == "nodes") {
            good = r.begin_array();
            while (good && r.next_element()) {
                std::string node;
                good = r.read(node) && protocol::is_name(node);
                if (nodes.size() < most) {
                    nodes.push_back(std::move(node));
                }
            }
        } else {
            good = r.skip();
        }
    }
    if (!good || !r.at_end() || !is_instance(digest)) {
        return {};
    }
    std::ranges::sort(nodes);
    return node_names{.digest = std::move(digest), .nodes = std::move(nodes)};
}

} // namespace cles::bridging
