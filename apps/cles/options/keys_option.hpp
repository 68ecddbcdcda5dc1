// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace tool {

/// What to do about the address of a node with security, without keys.
inline constexpr const char* keys_needed = "needs the key of a member: give --keys DIR, or set CLES_KEYS";

/// --keys: the directory with the key of a node or of a fleet. The default is CLES_KEYS. Commands that manage such a
/// directory otherwise use a folder beside the user's configuration; those that talk to nodes use no key.
class keys_option {
  public:
    /// For commands that manage the directory; `help` says what is in it.
    void add_to(CLI::App& command, const std::string& help);
    /// For commands that talk to nodes.
    void add_optional_to(CLI::App& command, const std::string& help);

    /// \throws usage_error if none was given and there is no default
    [[nodiscard]] std::string directory() const;
    /// The directory of --keys or CLES_KEYS; empty without both.
    [[nodiscard]] std::string given_directory() const;
    /// That of --keys.
    [[nodiscard]] const std::string& given() const noexcept { return given_; }

  private:
    std::string given_;
};

} // namespace tool
