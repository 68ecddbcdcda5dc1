// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_library.hpp"

// With the standard library's file system no further library of Boost is linked.
#ifndef BOOST_DLL_USE_STD_FS
#define BOOST_DLL_USE_STD_FS
#endif
#include <boost/dll/shared_library.hpp>

#include <cstddef>
#include <exception>
#include <system_error>

#include <dlfcn.h>

namespace cles::runtime {

// -- search --------------------------------------------------------------------------------------------------------

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

// -- load ----------------------------------------------------------------------------------------------------------

namespace {

using entry_function = const cles_plugin*();

std::string missing_entry_message(const boost::dll::shared_library& library) {
    constexpr unsigned max_version = 16;
    for (unsigned version = 2; version <= max_version; ++version) {
        if (library.has("cles_plugin_v" + std::to_string(version))) {
            return "it was made for version " + std::to_string(version) + " of the plugin ABI, this host has version " +
                   std::to_string(CLES_PLUGIN_ABI_MAJOR);
        }
    }
    return std::string{"it is not a plugin: it has no function '"} + CLES_PLUGIN_ENTRY + "'";
}

const cles_plugin& call_entry(const std::string& path, const boost::dll::shared_library& library) {
    if (!library.has(CLES_PLUGIN_ENTRY)) {
        throw plugin_error(path, missing_entry_message(library));
    }
    const cles_plugin* described = nullptr;
    try {
        described = library.get<entry_function>(CLES_PLUGIN_ENTRY)();
    } catch (const std::exception& e) {
        throw plugin_error(path, std::string{"its entry threw: "} + e.what());
    } catch (...) {
        throw plugin_error(path, "its entry threw something that is not an exception");
    }
    if (described == nullptr) {
        throw plugin_error(path, "its entry returns no description");
    }
    return *described;
}

void check_version(const std::string& path, const cles_plugin& described) {
    if (described.size < offsetof(cles_plugin, name)) {
        throw plugin_error(path, "its description is too short");
    }
    const auto wanted = std::to_string(described.abi_major) + "." + std::to_string(described.abi_minor);
    if (described.abi_major != CLES_PLUGIN_ABI_MAJOR || described.abi_minor > CLES_PLUGIN_ABI_MINOR) {
        throw plugin_error(path, "it needs version " + wanted + " of the plugin ABI, this host has " +
                                     std::to_string(CLES_PLUGIN_ABI_MAJOR) + "." +
                                     std::to_string(CLES_PLUGIN_ABI_MINOR));
    }
    const std::size_t min_size = described.abi_minor == 0 ? offsetof(cles_plugin, check) : sizeof(cles_plugin);
    if (described.size < min_size || described.start == nullptr) {
        throw plugin_error(path, "its description lacks members of version " + wanted + " of the plugin ABI");
    }
}

// What the loader says, with the path of the file where it knows it by another name.
std::string loader_message(std::string why, const std::string& opened, const plugin_file& file) {
    const auto& path = file.path().string();
    for (auto at = why.find(opened); at != std::string::npos; at = why.find(opened, at + path.size())) {
        why.replace(at, opened.size(), path);
    }
    if (file.is_checked() && why.find("cannot open shared object file") != std::string::npos) {
        why += " (with 'security' or 'sha256', $ORIGIN in a plugin is not its folder)";
    }
    return why;
}

} // namespace

std::shared_ptr<const boost::dll::shared_library> open_library(const std::string& path, const plugin_file& file) {
    const auto opened = file.loader_path(path);
    if (file.is_checked()) {
        file.keep_open();
    }
    auto library = std::make_shared<boost::dll::shared_library>();
    std::error_code failed;
    library->load(opened, failed, boost::dll::load_mode::rtld_now);
    if (failed) {
        const char* why = ::dlerror();
        throw plugin_error(path,
                           "it cannot be loaded: " + loader_message(why == nullptr ? "" : why, opened.string(), file));
    }
    return library;
}

const cles_plugin& describe_plugin(const std::string& path, const boost::dll::shared_library& library) {
    const auto& described = call_entry(path, library);
    check_version(path, described);
    return described;
}

} // namespace cles::runtime
