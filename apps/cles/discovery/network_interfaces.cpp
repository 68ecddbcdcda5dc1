// SPDX-License-Identifier: BSL-1.0
#include "discovery/network_interfaces.hpp"

#include <algorithm>
#include <array>
#include <memory>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

namespace tool {

std::vector<net_interface> interfaces_of_host() {
    ifaddrs* first = nullptr;
    if (::getifaddrs(&first) != 0) {
        return {};
    }
    const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all{first, &::freeifaddrs};
    std::vector<net_interface> result;
    for (const auto* entry = first; entry != nullptr; entry = entry->ifa_next) {
        const std::string name = entry->ifa_name;
        auto at = std::find_if(result.begin(), result.end(), [&](const net_interface& i) { return i.name == name; });
        if (at == result.end()) {
            at = result.insert(result.end(), {.name = name,
                                              .up = (entry->ifa_flags & IFF_UP) != 0,
                                              .loopback = (entry->ifa_flags & IFF_LOOPBACK) != 0,
                                              .multicast = (entry->ifa_flags & IFF_MULTICAST) != 0});
        }
        if (entry->ifa_addr != nullptr && entry->ifa_addr->sa_family == AF_INET && at->address.empty()) {
            std::array<char, INET_ADDRSTRLEN> text{};
            const auto* address = reinterpret_cast<const sockaddr_in*>(entry->ifa_addr);
            if (::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size()) != nullptr) {
                at->address = text.data();
            }
        }
    }
    return result;
}

} // namespace tool
