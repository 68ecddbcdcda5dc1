// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace cles::runtime {

/// Why a plugin cannot be used. `what()` begins with its path, as the configuration names it, and says the rest in one
/// line.
class plugin_error : public std::runtime_error {
  public:
    /// \param setting where one of its settings is to blame: that one's key, empty for all of them together
    plugin_error(const std::string& path, const std::string& why, std::optional<std::string> setting = std::nullopt)
        : std::runtime_error(path + ": " + why), setting_(std::move(setting)) {}

    [[nodiscard]] const std::optional<std::string>& setting() const noexcept { return setting_; }

  private:
    std::optional<std::string> setting_;
};

} // namespace cles::runtime
