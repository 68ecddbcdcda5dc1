// SPDX-License-Identifier: BSL-1.0
#include "discovery/host.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
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
    std::ifstream file{table};
    std::string line;
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

} // namespace

std::vector<network_interface> network_interfaces() {
    ifaddrs* first = nullptr;
    if (::getifaddrs(&first) != 0) {
        return {};
    }
    const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all{first, &::freeifaddrs};
    std::vector<network_interface> result;
    for (const auto* entry = first; entry != nullptr; entry = entry->ifa_next) {
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
            std::getline(std::ifstream{process->path() / "comm"}, name);
            return name.append(" (process ").append(number).append(")");
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
