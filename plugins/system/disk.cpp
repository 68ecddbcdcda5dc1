// SPDX-License-Identifier: BSL-1.0
#include "disk.hpp"

#include "fields.hpp"
#include "kernel_file.hpp"

#include <algorithm>

#include <sys/statvfs.h>

namespace sysinfo {
namespace {

constexpr std::size_t most_file_systems = 64;
constexpr std::size_t most_disks = 64;
constexpr std::uint64_t sector = 512; // whatever the disk's own is

// Spaces and such are written as \040.
std::string unescaped(std::string_view text) {
    std::string out;
    const auto is_octal = [](char c) { return c >= '0' && c <= '7'; };
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '\\' && text.size() - i > 3 && is_octal(text[i + 1]) && is_octal(text[i + 2]) &&
            is_octal(text[i + 3])) {
            out.push_back(static_cast<char>((text[i + 1] - '0') * 64 + (text[i + 2] - '0') * 8 + (text[i + 3] - '0')));
            i += 3;
        } else {
            out.push_back(text[i]);
        }
    }
    return out;
}

bool is_part_of(std::string_view part, std::string_view whole) {
    if (part.size() <= whole.size() || !part.starts_with(whole)) {
        return false;
    }
    auto rest = part.substr(whole.size());
    const auto last = whole.back();
    if (last >= '0' && last <= '9') { // nvme0n1p2
        if (rest.front() != 'p') {
            return false;
        }
        rest.remove_prefix(1);
    }
    return !rest.empty() && rest.find_first_not_of("0123456789") == std::string_view::npos;
}

} // namespace

// /dev/sda1 / ext4 rw,relatime 0 0
std::vector<file_system> parse_mounts(std::string_view mounts) {
    std::vector<file_system> out;
    std::string_view line;
    while (next_line(mounts, line) && out.size() < most_file_systems) {
        fields f{line};
        file_system entry;
        entry.device = unescaped(f.next());
        entry.mount = unescaped(f.next());
        entry.type = f.next();
        const auto seen = [&](const file_system& other) {
            return other.device == entry.device || other.mount == entry.mount;
        };
        const bool local = entry.device.starts_with("/dev/") || entry.mount == "/";
        if (local && std::none_of(out.begin(), out.end(), seen)) {
            out.push_back(std::move(entry));
        }
    }
    return out;
}

//    8       0 sda 5120 120 409600 900 700 80 16384 300 0 1100 1200 ...
std::vector<disk_traffic> parse_disk_traffic(std::string_view diskstats) {
    std::vector<disk_traffic> out;
    std::string_view line;
    while (next_line(diskstats, line) && out.size() < most_disks) {
        fields f{line};
        f.skip(2);
        disk_traffic entry;
        entry.device = f.next();
        f.skip(2);
        entry.read = f.number<std::uint64_t>() * sector;
        f.skip(3);
        entry.written = f.number<std::uint64_t>() * sector;
        f.skip(2);
        entry.busy_ms = f.number<std::uint64_t>();
        const bool used = entry.read != 0 || entry.written != 0;
        const auto holds = [&](const disk_traffic& other) { return is_part_of(entry.device, other.device); };
        if (used && std::none_of(out.begin(), out.end(), holds)) {
            out.push_back(std::move(entry));
        }
    }
    return out;
}

disk read_disk() {
    disk out{.file_systems = parse_mounts(read_kernel_file("/proc/self/mounts", "file systems")),
             .disks = parse_disk_traffic(read_if_there("/proc/diskstats"))};
    const auto unknown = [](file_system& f) {
        struct statvfs about {};
        if (::statvfs(f.mount.c_str(), &about) != 0) {
            return true;
        }
        const std::uint64_t block = about.f_frsize;
        f.size = about.f_blocks * block;
        f.free = about.f_bfree * block;
        f.available = about.f_bavail * block;
        return false;
    };
    std::erase_if(out.file_systems, unknown);
    return out;
}

} // namespace sysinfo
