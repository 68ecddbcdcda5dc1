// SPDX-License-Identifier: BSL-1.0
#include "discovery/host.hpp"

#include "system/whole_file.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace tool {
namespace {

namespace fs = std::filesystem;

/// A line of a table such as /proc/net/tcp (proc(5)).
struct socket_entry {
    std::string local;
    std::string state;
    std::string inode;
};

// Nothing if it cannot be read.
std::optional<std::vector<socket_entry>> sockets_in(const std::string& table) {
    std::vector<socket_entry> out;
    std::string text;
    std::string line;
    if (read_file(table, text)) {
        return {};
    }
    std::istringstream file{text};
    if (!std::getline(file, line)) { // the header
        return {};
    }
    while (std::getline(file, line)) {
        std::istringstream fields{line};
        std::string skipped;
        socket_entry entry;
        // sl local remote state queues timers retransmissions uid timeout inode
        if (fields >> skipped >> entry.local >> skipped >> entry.state >> skipped >> skipped >> skipped >> skipped >>
            skipped >> entry.inode) {
            out.push_back(std::move(entry));
        }
    }
    return out;
}

// Adds the names of the sockets at that port under /proc/PID/fd.
void add_sockets(const std::string& table, bool only_listening, std::uint16_t port, std::set<std::string>& out) {
    std::array<char, 8> suffix{};
    std::snprintf(suffix.data(), suffix.size(), ":%04X", static_cast<unsigned>(port));
    const auto sockets = sockets_in(table);
    for (const auto& entry : sockets.value_or(std::vector<socket_entry>{})) {
        if (entry.local.ends_with(suffix.data()) && (!only_listening || entry.state == "0A")) {
            out.insert("socket:[" + entry.inode + "]");
        }
    }
}

bool has_open(const fs::path& process, const std::set<std::string>& sockets) {
    std::error_code code;
    for (fs::directory_iterator file{process / "fd", code}; !code && file != fs::directory_iterator{};
         file.increment(code)) {
        std::error_code gone;
        if (sockets.contains(fs::read_symlink(*file, gone).string())) {
            return true;
        }
    }
    return false;
}

// As the kernel writes a local address: the four bytes in the order of memory, read as one number, and the port.
std::string table_form(const cles::multicast_options& group) {
    in_addr address{};
    std::array<char, 16> text{};
    if (::inet_pton(AF_INET, group.group.c_str(), &address) != 1) {
        return {};
    }
    std::snprintf(text.data(), text.size(), "%08X:%04X", static_cast<unsigned>(address.s_addr),
                  static_cast<unsigned>(group.port));
    return text.data();
}

using interface_addresses = std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)>;

// Null if they cannot be determined.
interface_addresses all_interface_addresses() {
    ifaddrs* first = nullptr;
    return {::getifaddrs(&first) == 0 ? first : nullptr, &::freeifaddrs};
}

// Of IPv4 and IPv6, without port and zone; otherwise empty.
std::string_view address_bytes(const sockaddr* of) {
    if (of != nullptr && of->sa_family == AF_INET) {
        return {reinterpret_cast<const char*>(&reinterpret_cast<const sockaddr_in*>(of)->sin_addr), sizeof(in_addr)};
    }
    if (of != nullptr && of->sa_family == AF_INET6) {
        return {reinterpret_cast<const char*>(&reinterpret_cast<const sockaddr_in6*>(of)->sin6_addr), sizeof(in6_addr)};
    }
    return {};
}

// 0.0.0.0 and :: lead to this host.
bool is_loopback_or_unspecified(std::string_view bytes) {
    constexpr auto is_zero = [](char c) { return c == 0; };
    const bool is_v4_loopback = bytes.size() == sizeof(in_addr) && bytes.front() == 127;
    const bool is_v6_loopback =
        bytes.size() == sizeof(in6_addr) && bytes.back() == 1 && std::all_of(bytes.begin(), bytes.end() - 1, is_zero);
    return is_v4_loopback || is_v6_loopback || std::all_of(bytes.begin(), bytes.end(), is_zero);
}

// Nothing if it is a name, and only addresses are wanted, or if it is not known.
std::optional<host_addresses> look_up(const std::string& host, int flags) {
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM; // each address once
    hints.ai_flags = flags;
    addrinfo* first = nullptr;
    if (::getaddrinfo(host.c_str(), nullptr, &hints, &first) != 0) {
        return std::nullopt;
    }
    const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> found{first, &::freeaddrinfo};
    host_addresses result;
    for (const auto* each = first; each != nullptr; each = each->ai_next) {
        if (const auto bytes = address_bytes(each->ai_addr); !bytes.empty()) {
            result.emplace_back(bytes);
        }
    }
    return result;
}

} // namespace

host_addresses own_addresses() {
    const auto all = all_interface_addresses();
    host_addresses result;
    for (const auto* entry = all.get(); entry != nullptr; entry = entry->ifa_next) {
        if (const auto bytes = address_bytes(entry->ifa_addr); !bytes.empty()) {
            result.emplace_back(bytes);
        }
    }
    return result;
}

host_addresses addresses_of(const std::string& host) {
    static std::map<std::string, host_addresses> names;
    if (auto found = look_up(host, AI_NUMERICHOST)) {
        return *std::move(found);
    }
    const auto [at, is_new] = names.try_emplace(host);
    if (is_new) {
        at->second = look_up(host, 0).value_or(host_addresses{});
    }
    return at->second;
}

bool leads_here(const host_addresses& found, const host_addresses& own) {
    return std::any_of(found.begin(), found.end(), [&own](const std::string& each) {
        return is_loopback_or_unspecified(each) || std::find(own.begin(), own.end(), each) != own.end();
    });
}

bool is_own_host(const std::string& host) { return leads_here(addresses_of(host), own_addresses()); }

std::vector<network_interface> network_interfaces() {
    const auto all = all_interface_addresses();
    std::vector<network_interface> result;
    for (const auto* entry = all.get(); entry != nullptr; entry = entry->ifa_next) {
        const std::string name = entry->ifa_name;
        auto at = std::find_if(result.begin(), result.end(), [&](const auto& each) { return each.name == name; });
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

const network_interface* find_interface(const std::vector<network_interface>& all, std::string_view name) {
    const auto at = std::find_if(all.begin(), all.end(), [&](const auto& each) { return each.name == name; });
    return at == all.end() ? nullptr : &*at;
}

std::string process_listening_at(std::string_view protocol, std::uint16_t port) {
    std::set<std::string> sockets;
    const auto table = "/proc/net/" + std::string{protocol};
    add_sockets(table, protocol == "tcp", port, sockets);
    add_sockets(table + "6", protocol == "tcp", port, sockets);
    if (sockets.empty()) {
        return {};
    }
    std::error_code code;
    for (fs::directory_iterator process{"/proc", code}; !code && process != fs::directory_iterator{};
         process.increment(code)) {
        const auto number = process->path().filename().string();
        const bool is_process = std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
        if (is_process && has_open(process->path(), sockets)) {
            std::string name;
            static_cast<void>(read_file(process->path() / "comm", name));
            return name.substr(0, name.find('\n')).append(" (process ").append(number).append(")");
        }
    }
    return {};
}

bool has_no_listener(const cles::multicast_options& group) {
    const auto all = network_interfaces();
    const auto used = cles::interfaces_of(group);
    const bool only_loopback = std::all_of(used.begin(), used.end(), [&](const std::string& name) {
        const auto* each = find_interface(all, name);
        return each != nullptr && each->loopback;
    });
    const auto address = table_form(group);
    if (!only_loopback || address.empty()) {
        return false;
    }
    const auto sockets = sockets_in("/proc/net/udp");
    return sockets &&
           std::none_of(sockets->begin(), sockets->end(), [&](const auto& each) { return each.local == address; });
}

} // namespace tool
