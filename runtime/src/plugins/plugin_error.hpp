// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace cles::runtime {

/// Why a plugin cannot be used. `what()` is one line that begins with the plugin's path as written in the
/// configuration.
class plugin_error : public std::runtime_error {
  public:
    /// \param setting the key of the setting that is invalid, if one is; empty for all of them together
    plugin_error(const std::string& path, const std::string& why, std::optional<std::string> setting = std::nullopt)
        : std::runtime_error(path + ": " + why), setting_(std::move(setting)) {}

    [[nodiscard]] const std::optional<std::string>& setting() const noexcept { return setting_; }
    /// The key that is to blame, in the plugin's entry of the configuration.
    [[nodiscard]] virtual std::string key() const {
        return !setting_ ? "path" : setting_->empty() ? "config" : "config." + *setting_;
    }

  private:
    std::optional<std::string> setting_;
};

/// The file does not have the configured SHA-256.
class pin_error : public plugin_error {
  public:
    using plugin_error::plugin_error;
    [[nodiscard]] std::string key() const override { return "sha256"; }
};

} // namespace cles::runtime
