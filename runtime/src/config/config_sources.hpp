// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "config/config_overrides.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace cles::runtime {

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
