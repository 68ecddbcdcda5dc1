// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <string>
#include <utility>

namespace cles {

/// An invalid setting of a plugin; thrown by the `check()` of its settings, or by the function that registers its
/// tasks. The daemon's error message then names the setting's line in the configuration.
class setting_error : public error {
  public:
    /// \param key of the setting, such as "limit" or "cameras[2].rate"; empty: the settings as a whole
    setting_error(std::string key, std::string message)
        : error(errc::conversion, std::move(message)), key_(std::move(key)) {}

    [[nodiscard]] const std::string& key() const noexcept { return key_; }

  private:
    std::string key_;
};

} // namespace cles
