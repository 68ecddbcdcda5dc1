// SPDX-License-Identifier: BSL-1.0
#include "config/config.hpp"

#include <cles/link.hpp>
#include <cles/url.hpp>

#include <algorithm>
#include <set>

namespace cles::runtime {
namespace {

// A host's name may hold what a node's may not.
std::string node_name_of(const std::string& host) {
    std::string name = host.substr(0, host.find('.')).substr(0, 64);
    for (char& c : name) {
        const bool fits =
            (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
        c = fits ? c : '-';
    }
    return name.empty() || name == "self" || name == "any" || name == "all" ? "node" : name;
}

void check_exposure(const config& whole, const std::string& key, const std::string& text) {
    const auto where = parse_url(text);
    const auto* carrier = find_transport(where.scheme);
    if (!whole.insecure && carrier != nullptr && carrier->is_exposed(where)) {
        throw config_error(whole.place_of(key),
                           "'" + text + "' can be reached from other hosts, which takes 'insecure: true'");
    }
}

} // namespace

std::string config::place_of(const std::string& key) const {
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
    made.node = node_name_of(host);
    made.listen = {"tcp://127.0.0.1:25370", "udp://127.0.0.1:25370"};
    made.multicast = {.interface = "lo"};
    made.multicast.required = false; // nobody asked for it
    made.workers = cores == 0 ? 1 : cores;
    return made;
}

void check(const config& whole) {
    for (std::size_t i = 0; i < whole.listen.size(); ++i) {
        check_exposure(whole, "listen[" + std::to_string(i) + "]", whole.listen[i]);
    }
    if (whole.multicast.is_on() && whole.multicast.interface != "lo" && !whole.insecure) { // `auto` may be any
        throw config_error(whole.place_of("multicast"), "on '" + whole.multicast.interface +
                                                            "' other hosts take part, which takes 'insecure: true'");
    }
    if (whole.peers.contains(whole.node)) {
        throw config_error(whole.place_of("peers." + whole.node), "is this node's own name");
    }
    std::set<std::string> paths;
    for (std::size_t i = 0; i < whole.plugins.size(); ++i) {
        if (!paths.insert(whole.plugins[i].path).second) {
            throw config_error(whole.place_of("plugins[" + std::to_string(i) + "].path"),
                               "'" + whole.plugins[i].path + "' is loaded already");
        }
    }
}

} // namespace cles::runtime
