// SPDX-License-Identifier: BSL-1.0
#include "options/pool_option.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdlib>

namespace tool {

void add_pool_option(CLI::App& command, std::string& pool, const std::string& help) {
    command.add_option("--pool", pool, help + " (default CLES_POOL)")->type_name("NAME");
}

std::string pool_or_variable(const std::string& given) {
    const char* variable = std::getenv("CLES_POOL");
    return given.empty() && variable != nullptr ? variable : given;
}

} // namespace tool
