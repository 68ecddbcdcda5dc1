// SPDX-License-Identifier: BSL-1.0
#include "figures.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string_view>

#include <link.h>

namespace cles::perf::peers {
namespace {

// What every C++ program has.
constexpr std::array<std::string_view, 7> common_libraries{"libc.",    "libm.",       "libstdc++.", "libgcc_s.",
                                                           "ld-linux", "libpthread.", "libresolv."};

bool is_counted(const std::string& path) {
    const auto name = std::filesystem::path{path}.filename().string();
    return name.find(".so") != std::string::npos && std::none_of(common_libraries.begin(), common_libraries.end(),
                                                                 [&](auto known) { return name.starts_with(known); });
}

std::ifstream open_of(pid_t process, const char* file) {
    std::ifstream opened{"/proc/" + std::to_string(process) + '/' + file};
    if (!opened) {
        throw std::runtime_error("the process has ended, so that its footprint cannot be read");
    }
    return opened;
}

} // namespace

footprint footprint_of(pid_t process) {
    footprint found;
    auto status = open_of(process, "status");
    for (std::string line; std::getline(status, line);) {
        if (line.starts_with("VmHWM:")) {
            found.peak_kib = std::stoull(line.substr(6));
        }
    }
    auto maps = open_of(process, "maps");
    for (std::string line; std::getline(maps, line);) {
        if (const auto path = line.find('/'); path != std::string::npos && is_counted(line.substr(path))) {
            std::error_code gone;
            const auto bytes = std::filesystem::file_size(line.substr(path), gone);
            if (!gone) {
                found.libraries[line.substr(path)] = bytes;
            }
        }
    }
    return found;
}

std::uint64_t loaded_program_bytes() {
    std::uint64_t bytes = 0;
    ::dl_iterate_phdr(
        [](dl_phdr_info* object, std::size_t, void* sum) {
            // The first is the program itself.
            for (int i = 0; i < object->dlpi_phnum; ++i) {
                if (object->dlpi_phdr[i].p_type == PT_LOAD) {
                    *static_cast<std::uint64_t*>(sum) += object->dlpi_phdr[i].p_filesz;
                }
            }
            return 1;
        },
        &bytes);
    return bytes;
}

} // namespace cles::perf::peers
