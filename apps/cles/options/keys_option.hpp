// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace tool {

/// --keys: the directory with the key of a node or of a fleet. The default is CLES_KEYS, and without that a folder
/// beside the user's configuration.
class keys_option {
  public:
    /// `help` says what is in the directory.
    void add_to(CLI::App& command, const std::string& help);

    /// \throws usage_error if none was given and there is no default
    [[nodiscard]] std::string directory() const;

  private:
    std::string given_;
};

} // namespace tool
