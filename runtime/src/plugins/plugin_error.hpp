// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// Why a plugin cannot be used. `what()` is one line that begins with the plugin's path as written in the
/// configuration.
class plugin_error : public std::runtime_error {
  public:
    /// \param key the key that is to blame, in the plugin's entry of the configuration
    plugin_error(const std::string& path, const std::string& why, std::string key = "path")
        : std::runtime_error(path + ": " + why), path_size_(path.size()), key_(std::move(key)) {}

    [[nodiscard]] const std::string& key() const noexcept { return key_; }
    /// The same as `what()` without the path.
    [[nodiscard]] std::string_view why() const noexcept {
        constexpr std::string_view separator = ": ";
        return std::string_view{what()}.substr(path_size_ + separator.size());
    }

  private:
    std::size_t path_size_;
    std::string key_;
};

} // namespace cles::runtime
