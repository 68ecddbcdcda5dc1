// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace tool {

/// A variable of the environment; empty if it is not set.
inline std::string variable_or_nothing(const char* name) {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
}

/// The folder of CLES in the user's configuration; empty if there is no place for it.
inline std::filesystem::path user_folder() {
    if (const auto configuration = variable_or_nothing("XDG_CONFIG_HOME"); !configuration.empty()) {
        return std::filesystem::path{configuration} / "cles";
    }
    const auto home = variable_or_nothing("HOME");
    return home.empty() ? std::filesystem::path{} : std::filesystem::path{home} / ".config" / "cles";
}

} // namespace tool
