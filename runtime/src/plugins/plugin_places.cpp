// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_places.hpp"

#include "plugins/plugin_search.hpp"

namespace cles::runtime {

namespace fs = std::filesystem;

namespace {

fs::path from_config(const config& setup, const fs::path& path) {
    return path.is_absolute() || setup.file.empty() ? path
                                                    : (fs::path{setup.file}.parent_path() / path).lexically_normal();
}

} // namespace

std::string plugin_file(const config& setup, const plugin_config& wanted) {
    const fs::path path{wanted.path};
    if (!path.has_parent_path()) {
        return wanted.path;
    }
    const auto file = from_config(setup, path);
    return file.has_parent_path() ? file.string() : "./" + file.string();
}

std::vector<fs::path> plugin_folders(const config& setup) {
    std::vector<fs::path> folders;
    for (const auto& folder : setup.plugin_path) {
        folders.push_back(from_config(setup, folder));
    }
    std::error_code unknown;
    if (const auto program = fs::read_symlink("/proc/self/exe", unknown); !unknown) {
        const auto own = plugin_folders_of(program);
        folders.insert(folders.end(), own.begin(), own.end());
    }
    return folders;
}

} // namespace cles::runtime
