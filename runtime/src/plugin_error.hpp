// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <stdexcept>
#include <string>

namespace cles::runtime {

/// Why a plugin cannot be used. `what()` begins with its path, as the configuration names it, and says the rest in one
/// line.
class plugin_error : public std::runtime_error {
  public:
    plugin_error(const std::string& path, const std::string& why) : std::runtime_error(path + ": " + why) {}
};

} // namespace cles::runtime
