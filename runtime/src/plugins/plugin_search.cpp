// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_search.hpp"

#include "plugins/plugin_error.hpp"

namespace cles::runtime {

namespace fs = std::filesystem;

const char* const installed_plugins = CLES_INSTALLED_PLUGINS;

fs::path find_plugin(const std::string& path, const std::vector<fs::path>& folders) {
    std::error_code ignored;
    if (path.empty()) {
        throw plugin_error("''", "this is no path");
    }
    if (fs::path{path}.has_parent_path()) {
        if (!fs::exists(path, ignored)) {
            throw plugin_error(path, "there is no such file");
        }
        return path;
    }
    std::string looked;
    for (const auto& folder : folders) {
        if (fs::exists(folder / path, ignored)) {
            return folder / path;
        }
        looked += (looked.empty() ? "" : ", ") + folder.string();
    }
    throw plugin_error(path, looked.empty() ? "there is no folder where plugins are looked for"
                                            : "there is no such file in " + looked);
}

std::vector<fs::path> plugin_folders_of(const fs::path& program, const fs::path& installed) {
    const auto folder = program.parent_path();
    return {(folder / installed).lexically_normal(), (folder / ".." / "plugins").lexically_normal()};
}

} // namespace cles::runtime
