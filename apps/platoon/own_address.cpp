// SPDX-License-Identifier: BSL-1.0
#include "own_address.hpp"

#include <array>
#include <memory>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>

namespace platoon {

std::string own_address(const std::string& interface_name) {
    ifaddrs* first = nullptr;
    const bool told = ::getifaddrs(&first) == 0;
    const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all{first, &::freeifaddrs};
    for (const auto* each = told ? first : nullptr; each != nullptr; each = each->ifa_next) {
        std::array<char, INET_ADDRSTRLEN> text{};
        if (interface_name == each->ifa_name && (each->ifa_flags & IFF_LOOPBACK) == 0 && each->ifa_addr != nullptr &&
            each->ifa_addr->sa_family == AF_INET) {
            const auto* at = reinterpret_cast<const sockaddr_in*>(each->ifa_addr);
            ::inet_ntop(AF_INET, &at->sin_addr, text.data(), text.size());
            return text.data();
        }
    }
    return "127.0.0.1";
}

} // namespace platoon
