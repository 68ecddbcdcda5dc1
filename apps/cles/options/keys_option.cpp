// SPDX-License-Identifier: BSL-1.0
#include "options/keys_option.hpp"

#include "output/errors.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdlib>

namespace tool {
namespace {

// Empty if it is not set.
std::string variable(const char* name) {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
}

} // namespace

void keys_option::add_to(CLI::App& command, const std::string& help) {
    command.add_option("-k,--keys", given_, help + " (default CLES_KEYS, otherwise ~/.config/cles/keys)")
        ->type_name("DIR");
}

std::string keys_option::directory() const {
    if (!given_.empty()) {
        return given_;
    }
    if (auto set = variable("CLES_KEYS"); !set.empty()) {
        return set;
    }
    if (const auto configuration = variable("XDG_CONFIG_HOME"); !configuration.empty()) {
        return configuration + "/cles/keys";
    }
    if (const auto home = variable("HOME"); !home.empty()) {
        return home + "/.config/cles/keys";
    }
    throw usage_error("which directory has the keys? Give --keys DIR, or set CLES_KEYS");
}

} // namespace tool
