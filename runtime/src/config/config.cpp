// SPDX-License-Identifier: BSL-1.0
#include "config/config.hpp"

#include <cles/link.hpp>
#include <cles/url.hpp>

#include <algorithm>
#include <set>

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

void check_exposure(const config& setup, const std::string& key, const std::string& text) {
    const auto where = parse_url(text);
    const auto* carrier = find_transport(where.scheme);
    if (!setup.insecure && carrier != nullptr && carrier->is_exposed(where)) {
        throw config_error(setup.location_of(key),
                           "'" + text + "' can be reached from other hosts, which requires 'insecure: true'");
    }
}

} // namespace

std::string config::location_of(const std::string& key) const {
    for (auto known = key; !known.empty(); known.resize(std::min(known.find_last_of(".["), known.size()))) {
        if (const auto found = origins.find(known); found != origins.end()) {
            return found->second + ": " + key;
        }
        if (known.find_last_of(".[") == std::string::npos) {
            break;
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

void check(const config& setup) {
    for (std::size_t i = 0; i < setup.listen.size(); ++i) {
        check_exposure(setup, "listen[" + std::to_string(i) + "]", setup.listen[i]);
    }
    if (setup.multicast.is_on() && setup.multicast.interface != "lo" && !setup.insecure) { // `auto` may choose any
        throw config_error(setup.location_of("multicast"),
                           "'" + setup.multicast.interface +
                               "' can be reached from other hosts, which requires 'insecure: true'");
    }
    if (setup.peers.contains(setup.node)) {
        throw config_error(setup.location_of("peers." + setup.node), "is this node's own name");
    }
    std::set<std::string> paths;
    for (std::size_t i = 0; i < setup.plugins.size(); ++i) {
        if (!paths.insert(setup.plugins[i].path).second) {
            throw config_error(setup.location_of("plugins[" + std::to_string(i) + "].path"),
                               "'" + setup.plugins[i].path + "' is listed twice");
        }
    }
}

} // namespace cles::runtime
