// SPDX-License-Identifier: BSL-1.0
#include "discovery/network_interfaces.hpp"
#include "doctor/checks.hpp"

#include <algorithm>
#include <string>

namespace tool {
namespace {

std::string names_of(const std::vector<net_interface>& all) {
    std::string out;
    for (const auto& each : all) {
        if (each.up) {
            out.append(out.empty() ? "" : ", ").append(each.name).append(" ");
            out.append(each.address.empty() ? "without an IPv4 address" : each.address);
        }
    }
    return out.empty() ? "none is up" : out;
}

// Another one, by which the network could be reached.
const net_interface* better_than_loopback(const std::vector<net_interface>& all) {
    const auto at = std::find_if(all.begin(), all.end(), [](const net_interface& i) {
        return i.up && i.multicast && !i.loopback && !i.address.empty();
    });
    return at == all.end() ? nullptr : &*at;
}

// What two machines take, by this interface of this one.
std::string for_other_hosts(const net_interface& by, const std::string& chosen, const cles::multicast_options& where) {
    return "to reach other hosts: CLES_MULTICAST=" + chosen +
           " (there their own interface), nodes with --listen tcp://" + by.address + " --insecure, and UDP port " +
           std::to_string(where.port) + " open";
}

void check_chosen(const std::string& name, const cles::multicast_options& where, const std::vector<net_interface>& all,
                  findings& found) {
    const auto at = std::find_if(all.begin(), all.end(), [&](const net_interface& i) { return i.name == name; });
    if (at == all.end()) {
        found.push_back({"interfaces", verdict::failure, "multicast is to go by " + name + ", and there is none",
                         "name one that there is by --multicast, CLES_MULTICAST or multicast.interface in clesd.yaml"});
    } else if (!at->up) {
        found.push_back({"interfaces", verdict::failure, "multicast is to go by " + name + ", which is down",
                         "ip link set " + name + " up"});
    } else if (at->address.empty()) {
        found.push_back({"interfaces", verdict::failure,
                         "multicast is to go by " + name + ", which has no IPv4 address",
                         "give it one: multicast of CLES is IPv4"});
    } else if (!at->multicast && !at->loopback) {
        found.push_back({"interfaces", verdict::warning, name + " says that it carries no multicast",
                         "ip link set " + name + " multicast on, or find nodes by seeds and --at"});
    } else if (at->loopback && where.interface != name) {
        found.push_back({"interfaces", verdict::ok, "multicast goes by " + name + ", for nodes on this host"});
    } else if (at->loopback) {
        const auto* other = better_than_loopback(all);
        found.push_back({"interfaces", verdict::ok,
                         "multicast goes by " + name + ": only nodes on this host find each other",
                         other == nullptr ? "" : for_other_hosts(*other, other->name, where)});
    } else {
        found.push_back(
            {"interfaces", verdict::ok, "multicast goes by " + name, for_other_hosts(*at, where.interface, where)});
    }
}

} // namespace

void check_interfaces(const cles::multicast_options& where, findings& found) {
    const auto all = interfaces_of_host();
    found.push_back({"interfaces", verdict::ok, names_of(all)});
    const auto chosen = cles::interfaces_of(where);
    for (const auto& name : chosen) {
        check_chosen(name, where, all, found);
    }
    if (where.is_on() && chosen.empty()) {
        found.push_back({"interfaces", verdict::failure,
                         "multicast is to go by 'auto', and no interface is up with an IPv4 address",
                         "ip link set lo up"});
    }
}

} // namespace tool
