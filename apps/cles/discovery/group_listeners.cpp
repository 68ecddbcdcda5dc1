// SPDX-License-Identifier: BSL-1.0
#include "discovery/group_listeners.hpp"

#include "discovery/network_interfaces.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

#include <arpa/inet.h>

namespace tool {
namespace {

bool is_loopback(const std::string& interface) {
    const auto all = interfaces_of_host();
    return std::any_of(all.begin(), all.end(),
                       [&](const net_interface& i) { return i.name == interface && i.loopback; });
}

// As the kernel writes a local address in /proc/net/udp (proc(5)): the four bytes as they lie in memory, read as one
// number, and the port.
std::string as_in_table(const cles::multicast_options& where) {
    in_addr address{};
    std::array<char, 16> text{};
    if (::inet_pton(AF_INET, where.group.c_str(), &address) != 1) {
        return {};
    }
    std::snprintf(text.data(), text.size(), "%08X:%04X", static_cast<unsigned>(address.s_addr),
                  static_cast<unsigned>(where.port));
    return text.data();
}

} // namespace

bool nobody_listens(const cles::multicast_options& where) {
    const auto interfaces = cles::interfaces_of(where);
    if (!std::all_of(interfaces.begin(), interfaces.end(), is_loopback)) {
        return false;
    }
    std::ifstream sockets{"/proc/net/udp"};
    const auto wanted = as_in_table(where);
    std::string line;
    if (wanted.empty() || !std::getline(sockets, line)) { // its heading
        return false;
    }
    while (std::getline(sockets, line)) {
        std::istringstream fields{line};
        std::string number;
        std::string local;
        if (fields >> number >> local && local == wanted) {
            return false;
        }
    }
    return true;
}

} // namespace tool
