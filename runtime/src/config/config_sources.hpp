// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "config/config_file.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace cles::runtime {

/// Reads CLES_NODE, CLES_POOL, CLES_LISTEN and CLES_SEEDS (lists separated by commas), CLES_MULTICAST, CLES_KEYS and
/// CLES_LOG.
/// Empty variables are ignored. \param variable returns the value of a variable, or null
overrides from_environment(const std::function<const char*(const char*)>& variable);

/// The sources of a daemon's configuration: flags override the environment, which overrides the file, which overrides
/// the defaults. Kept in order to reload the configuration.
struct config_sources {
    std::optional<std::string> file; ///< given by flag
    overrides flags;
    std::function<const char*(const char*)> variable; ///< returns an environment variable, or null
    std::string host;                                 ///< the host's name
    std::uint32_t cores = 1;
    /// The name of the key in that directory, which is the node's unless another is configured; empty if it cannot be
    /// read.
    std::function<std::string(const std::string& directory)> name_of_key{};
};

/// The files of which the first that exists is read if none is named: `./clesd.yaml`,
/// `$XDG_CONFIG_HOME/cles/clesd.yaml` (`$HOME/.config` if that is not set), `/etc/cles/clesd.yaml`.
std::vector<std::string> default_locations(const std::function<const char*(const char*)>& variable);

/// \throws config_error
config load(const config_sources& from);

} // namespace cles::runtime
