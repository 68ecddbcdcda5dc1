// SPDX-License-Identifier: BSL-1.0
#include "federation/heartbeat.hpp"

#include <cles/convert.hpp>
#include <cles/json_reader.hpp>

#include "federation/subject.hpp"
#include "protocol/fnv1a.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <utility>

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

// The members as they are sent.
struct heartbeat_members {
    std::string node;
    std::optional<std::uint64_t> interval_ms{};
    std::string names;
    std::optional<std::string> replaces{};
    std::optional<bool> leaving{};
    std::optional<bool> starting{};
    std::optional<bool> closing{};
    std::optional<std::uint32_t> roster{};
    std::optional<bool> sessions{};
};
BOOST_DESCRIBE_STRUCT(heartbeat_members, (),
                      (node, interval_ms, names, replaces, leaving, starting, closing, roster, sessions))

template <class T>
bool read_all(std::string_view text, T& read) {
    json_reader r{text, max_depth};
    return read_json(r, read) && r.at_end();
}

} // namespace

std::string text_of(const heartbeat& said) {
    const auto flag = [](bool is_set) { return is_set ? std::optional{true} : std::nullopt; };
    return to_json(heartbeat_members{.node = said.node,
                                     .interval_ms = static_cast<std::uint64_t>(said.interval.count()),
                                     .names = said.names,
                                     .replaces = said.replaces.empty() ? std::nullopt : std::optional{said.replaces},
                                     .leaving = flag(said.leaving),
                                     .starting = flag(said.starting),
                                     .closing = flag(said.closing),
                                     .roster = said.roster == 0 ? std::nullopt : std::optional{said.roster},
                                     .sessions = flag(said.sessions)});
}

std::optional<heartbeat> parse_heartbeat(std::string_view text) {
    heartbeat_members read;
    const bool is_complete = read_all(text, read);
    auto replaces = read.replaces.value_or("");
    if (!is_complete || !protocol::is_name(read.node) || !is_instance(read.names) ||
        !(replaces.empty() || is_instance(replaces))) {
        return {};
    }
    const auto interval = std::clamp(read.interval_ms.value_or(0), min_interval, max_interval);
    return heartbeat{.node = std::move(read.node),
                     .interval = std::chrono::milliseconds{interval},
                     .names = std::move(read.names),
                     .replaces = std::move(replaces),
                     .leaving = read.leaving.value_or(false),
                     .starting = read.starting.value_or(false),
                     .closing = read.closing.value_or(false),
                     .roster = read.roster.value_or(0),
                     .sessions = read.sessions.value_or(false)};
}

node_names names_of(std::vector<std::string> nodes) {
    std::ranges::sort(nodes);
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    const auto digest = hash_of(nodes);
    return {.digest = instance_text(digest), .nodes = std::move(nodes)};
}

std::string text_of(const node_names& said) { return to_json(said); }

// No more than `most` names are kept while it is read.
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
