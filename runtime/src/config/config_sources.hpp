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

/// Where a daemon's configuration comes from: a flag goes before the environment, that before the file, that before
/// the defaults. Kept, so that it can be read again.
struct config_sources {
    std::optional<std::string> file; ///< by flag
    overrides flags;
    std::function<const char*(const char*)> variable; ///< of the environment; null where there is none
    std::string host;                                 ///< what the machine is called
    std::uint32_t cores = 1;
};

/// The files that are looked for where none is named, the first that is there being taken: `./clesd.yaml`,
/// `$XDG_CONFIG_HOME/cles/clesd.yaml` (`$HOME/.config` where that is not set), `/etc/cles/clesd.yaml`.
std::vector<std::string> usual_places(const std::function<const char*(const char*)>& variable);

/// \throws config_error
config load(const config_sources& from);

} // namespace cles::runtime
