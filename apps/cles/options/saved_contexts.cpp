// SPDX-License-Identifier: BSL-1.0
#include "options/saved_contexts.hpp"

#include "options/user_folder.hpp"
#include "output/errors.hpp"
#include "system/whole_file.hpp"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace tool {
namespace {

namespace fs = std::filesystem;

// Empty if there is no place for it.
fs::path contexts_file() {
    const auto folder = user_folder();
    return folder.empty() ? fs::path{} : folder / "contexts.json";
}

saved_context find_used_context() {
    const char* chosen = std::getenv("CLES_CONTEXT");
    if (chosen != nullptr && *chosen == '\0') { // none, whatever the file contains
        return {};
    }
    const auto all = read_contexts();
    const auto name = name_of_used_context(all);
    if (name.empty()) {
        return {};
    }
    const auto found = all.contexts.find(name);
    if (found == all.contexts.end()) {
        throw usage_error((chosen != nullptr ? "CLES_CONTEXT '" : "the context '") + name +
                          "': there is no such context; 'cles context list' shows them");
    }
    return found->second;
}

} // namespace

saved_contexts read_contexts() {
    const auto path = contexts_file();
    std::string text;
    const auto failed = read_file(path, text);
    if (std::error_code code;
        path.empty() || (failed && fs::symlink_status(path, code).type() == fs::file_type::not_found)) {
        return {};
    }
    if (failed) { // otherwise those in it would be lost when it is replaced
        throw usage_error("the contexts in " + path.string() + " cannot be read: " + failed.message());
    }
    saved_contexts out;
    std::string why;
    if (!cles::from_json(text, out, &why)) {
        throw usage_error("the contexts in " + path.string() + " cannot be read: " + why);
    }
    return out;
}

void write_contexts(const saved_contexts& all) {
    const auto path = contexts_file();
    if (path.empty()) {
        throw std::runtime_error("where are contexts saved? Set HOME or XDG_CONFIG_HOME");
    }
    const auto fail = [&](const std::string& why) {
        throw std::runtime_error("cannot write " + path.string() + ": " + why);
    };
    std::error_code code;
    fs::create_directories(path.parent_path(), code);
    if (code) {
        fail(code.message());
    }
    auto made = path;
    made += ".new";
    const auto text = cles::to_json(all) + "\n";
    auto* const file = std::fopen(made.c_str(), "we"); // e: close-on-exec
    const bool is_written = file != nullptr && std::fwrite(text.data(), 1, text.size(), file) == text.size();
    if ((file != nullptr && std::fclose(file) != 0) || !is_written) {
        fail(std::generic_category().message(errno));
    }
    fs::rename(made, path, code);
    if (code) {
        fail(code.message());
    }
}

std::string name_of_used_context(const saved_contexts& all) {
    const char* chosen = std::getenv("CLES_CONTEXT");
    return chosen != nullptr ? chosen : all.used;
}

const saved_context& used_context() {
    static const saved_context used = find_used_context();
    return used;
}

} // namespace tool
