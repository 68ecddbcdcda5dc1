// SPDX-License-Identifier: BSL-1.0
#include "discovery/sockets.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <system_error>
#include <vector>

namespace tool {
namespace {

namespace fs = std::filesystem;

// From a table such as /proc/net/tcp (proc(5)): what its sockets are called under /proc/PID/fd.
void add_sockets(const std::string& table, bool only_listening, std::uint16_t port, std::set<std::string>& out) {
    std::array<char, 8> wanted{};
    std::snprintf(wanted.data(), wanted.size(), ":%04X", static_cast<unsigned>(port));
    std::ifstream file{table};
    std::string line;
    std::getline(file, line); // its heading
    while (std::getline(file, line)) {
        std::istringstream fields{line};
        std::string skipped;
        std::string local;
        std::string state;
        std::string inode;
        // sl local remote state queues timers retransmissions uid timeout inode
        if (fields >> skipped >> local >> skipped >> state >> skipped >> skipped >> skipped >> skipped >> skipped >>
                inode &&
            local.ends_with(wanted.data()) && (!only_listening || state == "0A")) {
            out.insert("socket:[" + inode + "]");
        }
    }
}

bool holds(const fs::path& process, const std::set<std::string>& sockets) {
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

} // namespace

std::string holder_of(std::string_view protocol, std::uint16_t port) {
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
        if (is_process && holds(process->path(), sockets)) {
            std::string name;
            std::getline(std::ifstream{process->path() / "comm"}, name);
            return name.append(" (process ").append(number).append(")");
        }
    }
    return {};
}

} // namespace tool
