// SPDX-License-Identifier: BSL-1.0
#include "config/config.hpp"

#include <cles/link.hpp>
#include <cles/url.hpp>

#include <algorithm>
#include <set>
#include <string_view>

namespace cles::runtime {
namespace {

// A host name may contain characters that a node name may not.
std::string to_valid_node_name(const std::string& host) {
    std::string name = host.substr(0, host.find('.')).substr(0, 64);
    for (char& c : name) {
        const bool valid =
            (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
        c = valid ? c : '-';
    }
    return name.empty() || name == "self" || name == "any" || name == "all" ? "node" : name;
}

[[noreturn]] void reject(const config& setup, const std::string& key, const std::string& why) {
    throw config_error(setup.location_of(key), why);
}

void check_url(const config& setup, const std::string& key, const std::string& text) {
    const auto where = parse_url(text);
    if (where.scheme == "tls" && !setup.security.is_on()) {
        reject(setup, key, "'" + text + "' requires 'security'");
    }
    if (where.scheme == "tcp" && setup.security.is_on()) {
        reject(setup, key, "'" + text + "' is refused with 'security': use 'tls'");
    }
}

void check_exposure(const config& setup, const std::string& key, const std::string& text) {
    const auto where = parse_url(text);
    const auto* carrier = find_transport(where.scheme);
    if (!setup.insecure && !setup.security.is_on() && carrier != nullptr && carrier->is_exposed(where)) {
        reject(setup, key, "'" + text + "' can be reached from other hosts, which requires 'insecure: true'");
    }
}

void check_federation(const config& setup) {
    if (!setup.insecure && !setup.security.is_on()) {
        reject(setup, "federation",
               "whoever reaches the NATS server can send requests, which requires 'security' or 'insecure: true'");
    }
    if (!setup.pool.empty() && setup.pool != setup.federation.pool) {
        reject(setup, "federation.pool",
               "'" + setup.federation.pool + "' is another pool than 'pool: " + setup.pool + "'");
    }
}

} // namespace

std::string config::location_of(const std::string& key) const {
    for (auto size = key.size(); size != 0 && size != std::string::npos; size = key.find_last_of(".[", size - 1)) {
        if (const auto found = origins.find(key.substr(0, size)); found != origins.end()) {
            return found->second + ": " + key;
        }
    }
    return key;
}

config default_config(const std::string& host, std::uint32_t cores) {
    config made;
    made.node = to_valid_node_name(host);
    made.listen = {"tcp://127.0.0.1:25370", "udp://127.0.0.1:25370"};
    made.multicast = {.interface = "lo"};
    made.multicast.required = false; // it was not requested explicitly
    made.workers = cores == 0 ? 1 : cores;
    return made;
}

void apply_security_defaults(config& setup) {
    if (!setup.security.is_on()) {
        return;
    }
    const auto is_set = [&](std::string_view key) {
        return std::ranges::any_of(setup.origins, [key](const auto& origin) {
            const auto& known = origin.first;
            return known == key || known.starts_with(std::string{key} + "[") ||
                   known.starts_with(std::string{key} + ".");
        });
    };
    if (!is_set("listen")) {
        setup.listen = {"tls://0.0.0.0:25370", "udp://0.0.0.0:25370"};
    }
    if (!is_set("multicast")) {
        setup.multicast.interface = "auto";
    }
}

void check(const config& setup) {
    for (std::size_t i = 0; i < setup.listen.size(); ++i) {
        const auto key = "listen[" + std::to_string(i) + "]";
        check_url(setup, key, setup.listen[i]);
        check_exposure(setup, key, setup.listen[i]);
    }
    for (std::size_t i = 0; i < setup.seeds.size(); ++i) {
        const auto key = "seeds[" + std::to_string(i) + "]";
        check_url(setup, key, setup.seeds[i]);
        if (setup.security.is_on() && parse_url(setup.seeds[i]).scheme == "udp") { // they are sealed for a known node
            reject(setup, key, "'" + setup.seeds[i] + "' names no node, as 'udp' requires with 'security': use 'tls'");
        }
    }
    constexpr std::size_t max_links = 16;
    if (setup.links.size() > max_links) {
        reject(setup, "links", std::to_string(setup.links.size()) + " names; at most 16 fit");
    }
    for (std::size_t i = 0; i < setup.links.size(); ++i) {
        if (setup.links[i] == setup.node) {
            reject(setup, "links[" + std::to_string(i) + "]", "'" + setup.node + "' is this node itself");
        }
    }
    for (const auto& [name, url] : setup.peers) {
        check_url(setup, "peers." + name, url);
    }
    if (setup.multicast.is_on() && setup.multicast.interface != "lo" && !setup.insecure &&
        !setup.security.is_on()) { // `auto` may choose any
        reject(setup, "multicast",
               "'" + setup.multicast.interface + "' can be reached from other hosts, which requires 'insecure: true'");
    }
    if (setup.federation.is_on()) {
        check_federation(setup);
    }
    if (setup.peers.contains(setup.node)) {
        reject(setup, "peers." + setup.node, "is this node's own name");
    }
    std::set<std::string> paths;
    for (std::size_t i = 0; i < setup.plugins.size(); ++i) {
        if (!paths.insert(setup.plugins[i].path).second) {
            reject(setup, "plugins[" + std::to_string(i) + "].path", "'" + setup.plugins[i].path + "' is listed twice");
        }
    }
}

} // namespace cles::runtime
