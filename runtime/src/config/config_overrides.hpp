// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace cles::runtime {

/// What the environment or the flags say over the file.
struct overrides {
    template <class T>
    struct given {
        T value{};
        std::string by; ///< "CLES_NODE", "--node"
    };

    std::optional<given<std::string>> node;
    std::optional<given<std::string>> pool;
    std::optional<given<bool>> allow_clash;
    std::optional<given<std::vector<std::string>>> listen;
    std::optional<given<std::vector<std::string>>> seeds;
    std::optional<given<std::string>> multicast;
    std::optional<given<std::string>> log;
};

/// CLES_NODE, CLES_POOL, CLES_LISTEN and CLES_SEEDS (several with commas between), CLES_MULTICAST, CLES_LOG. A variable
/// that is empty counts as not there. \param variable gives the value of a variable, or null
overrides from_environment(const std::function<const char*(const char*)>& variable);

/// \throws config_error naming the variable or flag
void apply(const overrides& wanted, config& over);

} // namespace cles::runtime
