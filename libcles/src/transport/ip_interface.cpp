// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_interface.hpp"

#include <boost/system/system_error.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {
namespace {

[[noreturn]] void refuse(int code) { throw boost::system::system_error{code, boost::system::system_category()}; }

using addresses = std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)>;

addresses addresses_of_host() {
    ifaddrs* first = nullptr;
    if (::getifaddrs(&first) != 0) {
        refuse(errno);
    }
    return {first, &::freeifaddrs};
}

core::network_interface interface_of(const ifaddrs& entry) {
    const auto flags = entry.ifa_flags;
    return {.name = entry.ifa_name,
            .index = static_cast<int>(::if_nametoindex(entry.ifa_name)),
            .loopback = (flags & IFF_LOOPBACK) != 0,
            .up = (flags & IFF_UP) != 0,
            .running = (flags & IFF_UP) != 0 && (flags & IFF_RUNNING) != 0,
            .multicast = (flags & IFF_MULTICAST) != 0,
            .point_to_point = (flags & IFF_POINTOPOINT) != 0};
}

// The first IPv4 address is the one that counts.
void take_address(core::network_interface& of, const ifaddrs& entry) noexcept {
    if (of.address == 0 && entry.ifa_addr != nullptr && entry.ifa_addr->sa_family == AF_INET) {
        sockaddr_in in{};
        std::memcpy(&in, entry.ifa_addr, sizeof in);
        of.address = ntohl(in.sin_addr.s_addr);
    }
}

} // namespace

core::network_interface find_interface(const std::string& name) {
    core::network_interface found;
    const auto all = addresses_of_host();
    for (const auto* entry = all.get(); entry != nullptr; entry = entry->ifa_next) {
        if (name == entry->ifa_name) {
            if (found.name.empty()) {
                found = interface_of(*entry);
            }
            take_address(found, *entry);
        }
    }
    if (found.index == 0) {
        refuse(ENODEV);
    }
    if (!found.up) {
        refuse(ENETDOWN);
    }
    if (found.address == 0) {
        refuse(EADDRNOTAVAIL);
    }
    return found;
}

std::vector<core::network_interface> interfaces_of_host() {
    std::vector<core::network_interface> all;
    const auto entries = addresses_of_host();
    for (const auto* entry = entries.get(); entry != nullptr; entry = entry->ifa_next) {
        auto here = interface_of(*entry);
        auto at = std::ranges::find(all, here.index, &core::network_interface::index);
        if (at == all.end()) { // an alias has the index of its interface
            at = all.insert(at, std::move(here));
        }
        take_address(*at, *entry);
    }
    std::erase_if(all, [](const auto& each) { return each.index == 0; }); // gone meanwhile
    std::ranges::sort(all, {}, &core::network_interface::index);
    return all;
}

} // namespace cles::transport
