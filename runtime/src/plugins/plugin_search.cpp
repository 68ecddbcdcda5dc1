// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_search.hpp"

namespace cles::runtime {

namespace fs = std::filesystem;

namespace {

// A relative path begins at the folder of the configuration file.
fs::path from_config(const config& setup, const fs::path& path) {
    return path.is_absolute() || setup.file.empty() ? path
                                                    : (fs::path{setup.file}.parent_path() / path).lexically_normal();
}

} // namespace

const char* const installed_plugins = CLES_INSTALLED_PLUGINS;

fs::path find_plugin(const std::string& path, const std::vector<fs::path>& folders) {
    std::error_code ignored;
    if (path.empty()) {
        throw plugin_error("''", "the path is empty");
    }
    if (fs::path{path}.has_parent_path()) {
        if (!fs::exists(path, ignored)) {
            throw plugin_error(path, "there is no such file");
        }
        return path;
    }
    std::string searched;
    for (const auto& folder : folders) {
        if (fs::exists(folder / path, ignored)) {
            return folder / path;
        }
        searched += (searched.empty() ? "" : ", ") + folder.string();
    }
    throw plugin_error(path, searched.empty() ? "there are no folders to search for plugins"
                                              : "there is no such file in " + searched);
}

std::vector<fs::path> default_plugin_folders(const fs::path& program, const fs::path& installed) {
    const auto folder = program.parent_path();
    return {(folder / installed).lexically_normal(), (folder / ".." / "plugins").lexically_normal()};
}

std::string resolve_plugin_path(const config& setup, const plugin_config& wanted) {
    const fs::path path{wanted.path};
    if (!path.has_parent_path()) {
        return wanted.path;
    }
    const auto file = from_config(setup, path);
    return file.has_parent_path() ? file.string() : "./" + file.string();
}

std::vector<fs::path> plugin_search_path(const config& setup) {
    std::vector<fs::path> folders;
    for (const auto& folder : setup.plugin_path) {
        folders.push_back(from_config(setup, folder));
    }
    std::error_code unknown;
    if (const auto program = fs::read_symlink("/proc/self/exe", unknown); !unknown) {
        const auto own = default_plugin_folders(program);
        folders.insert(folders.end(), own.begin(), own.end());
    }
    return folders;
}

} // namespace cles::runtime
