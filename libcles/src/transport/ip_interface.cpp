// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_interface.hpp"

#include <boost/system/system_error.hpp>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

namespace cles::transport {
namespace {

[[noreturn]] void refuse(int code) { throw boost::system::system_error{code, boost::system::system_category()}; }

/// Asks the kernel about an interface.
class query {
  public:
    explicit query(const std::string& name) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
        if (socket_ < 0) {
            refuse(errno);
        }
        std::memcpy(request_.ifr_name, name.data(), name.size());
    }
    query(const query&) = delete;
    query& operator=(const query&) = delete;
    ~query() { ::close(socket_); }

    const ifreq& ask(unsigned long what) {
        if (::ioctl(socket_, what, &request_) != 0) {
            refuse(errno);
        }
        return request_;
    }

  private:
    int socket_;
    ifreq request_{};
};

void take_flags(core::network_interface& of, unsigned flags) noexcept {
    of.loopback = (flags & IFF_LOOPBACK) != 0;
    of.running = (flags & IFF_UP) != 0 && (flags & IFF_RUNNING) != 0;
    of.multicast = (flags & IFF_MULTICAST) != 0;
    of.point_to_point = (flags & IFF_POINTOPOINT) != 0;
}

} // namespace

core::network_interface find_interface(const std::string& name) {
    if (name.empty() || name.size() >= IFNAMSIZ) {
        refuse(ENODEV);
    }
    core::network_interface found{.name = name};
    found.index = query{name}.ask(SIOCGIFINDEX).ifr_ifindex;
    const auto flags = query{name}.ask(SIOCGIFFLAGS).ifr_flags;
    if ((flags & IFF_UP) == 0) {
        refuse(ENETDOWN);
    }
    take_flags(found, static_cast<unsigned>(flags));
    query address{name};
    sockaddr_in in{};
    std::memcpy(&in, &address.ask(SIOCGIFADDR).ifr_addr, sizeof in);
    found.address = ntohl(in.sin_addr.s_addr);
    return found;
}

std::vector<core::network_interface> interfaces_of_host() {
    ifaddrs* first = nullptr;
    if (::getifaddrs(&first) != 0) {
        refuse(errno);
    }
    const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> entries{first, &::freeifaddrs};
    std::vector<core::network_interface> all;
    for (const auto* entry = first; entry != nullptr; entry = entry->ifa_next) {
        const auto index = static_cast<int>(::if_nametoindex(entry->ifa_name));
        auto at = std::find_if(all.begin(), all.end(), [&](const auto& each) { return each.index == index; });
        if (index != 0 && at == all.end()) { // an alias has the index of its interface
            at = all.insert(at, {.name = entry->ifa_name, .index = index});
            take_flags(*at, entry->ifa_flags);
        }
        if (at != all.end() && entry->ifa_addr != nullptr && entry->ifa_addr->sa_family == AF_INET &&
            at->address == 0) {
            sockaddr_in in{};
            std::memcpy(&in, entry->ifa_addr, sizeof in);
            at->address = ntohl(in.sin_addr.s_addr);
        }
    }
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.index < b.index; });
    return all;
}

} // namespace cles::transport
