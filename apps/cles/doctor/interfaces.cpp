// SPDX-License-Identifier: BSL-1.0
#include "discovery/host.hpp"
#include "doctor/checks.hpp"

#include <algorithm>
#include <string>
#include <vector>

namespace tool {
namespace {

std::string interfaces_text(const std::vector<network_interface>& all) {
    std::string out;
    for (const auto& each : all) {
        if (each.up) {
            out.append(out.empty() ? "" : ", ").append(each.name).append(" ");
            out.append(each.address.empty() ? "without an IPv4 address" : each.address);
        }
    }
    return out.empty() ? "none is up" : out;
}

// An interface over which other hosts could be reached, or null.
const network_interface* external_interface(const std::vector<network_interface>& all) {
    const auto at = std::find_if(all.begin(), all.end(), [](const network_interface& i) {
        return i.up && i.multicast && !i.loopback && !i.address.empty();
    });
    return at == all.end() ? nullptr : &*at;
}

// What both hosts need to work together over this interface.
std::string advice_for_other_hosts(const network_interface& interface, const std::string& selection,
                                   const cles::multicast_options& group, bool secured) {
    if (secured) {
        return "to reach other hosts: " + (selection == "auto" ? "" : "CLES_MULTICAST=" + selection + ", ") +
               "nodes with --keys and --listen tls://" + interface.address + ", UDP port " +
               std::to_string(group.port) + " and the TCP ports of the nodes open";
    }
    return "to reach other hosts: CLES_MULTICAST=" + selection +
           " (on each its own interface), nodes with --listen tcp://" + interface.address +
           " --insecure, and UDP port " + std::to_string(group.port) + " open";
}

void check_interface(const std::string& name, const cles::multicast_options& group,
                     const std::vector<network_interface>& all, bool secured, findings& found) {
    const auto used = "multicast is configured for " + name;
    const auto* interface = find_interface(all, name);
    if (interface == nullptr) {
        found.failure("interfaces", used + ", which does not exist",
                      "choose an existing one with --multicast, CLES_MULTICAST or multicast.interface in clesd.yaml");
    } else if (!interface->up) {
        found.failure("interfaces", used + ", which is down", "ip link set " + name + " up");
    } else if (interface->address.empty()) {
        found.failure("interfaces", used + ", which has no IPv4 address", "assign one: CLES uses IPv4 for multicast");
    } else if (!interface->multicast && !interface->loopback) {
        found.warning("interfaces", name + " does not support multicast according to its flags",
                      "ip link set " + name + " multicast on, or find nodes by seeds and --at");
    } else if (interface->loopback && group.interface != name) {
        found.ok("interfaces", "multicast uses " + name + ", for nodes on this host");
    } else if (interface->loopback) {
        const auto* other = external_interface(all);
        found.ok("interfaces", "multicast uses " + name + ": only nodes on this host find each other",
                 other == nullptr ? "" : advice_for_other_hosts(*other, other->name, group, secured));
    } else {
        found.ok("interfaces", "multicast uses " + name,
                 advice_for_other_hosts(*interface, group.interface, group, secured));
    }
}

} // namespace

void check_interfaces(const cles::multicast_options& group, bool secured, findings& found) {
    const auto all = network_interfaces();
    found.ok("interfaces", interfaces_text(all));
    const auto used = cles::interfaces_of(group);
    for (const auto& name : used) {
        check_interface(name, group, all, secured, found);
    }
    if (group.is_on() && used.empty()) {
        found.failure("interfaces", "multicast is configured for 'auto', and no interface is up with an IPv4 address",
                      "ip link set lo up");
    }
}

} // namespace tool
