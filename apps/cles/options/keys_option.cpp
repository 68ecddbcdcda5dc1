// SPDX-License-Identifier: BSL-1.0
#include "options/keys_option.hpp"

#include "options/user_folder.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

namespace tool {

void keys_option::add_to(CLI::App& command, const std::string& help) {
    command.add_option("-k,--keys", given_, help + " (default CLES_KEYS, otherwise ~/.config/cles/keys)")
        ->type_name("DIR");
}

void keys_option::add_optional_to(CLI::App& command, const std::string& help) {
    command.add_option("-k,--keys", given_, help + " (default CLES_KEYS, otherwise none)")->type_name("DIR");
}

std::string keys_option::given_directory() const { return given_.empty() ? variable_or_nothing("CLES_KEYS") : given_; }

std::string keys_option::directory() const {
    if (auto given = given_directory(); !given.empty()) {
        return given;
    }
    if (const auto folder = user_folder(); !folder.empty()) {
        return (folder / "keys").string();
    }
    throw usage_error("which directory has the keys? Give --keys DIR, or set CLES_KEYS");
}

} // namespace tool
