// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "plugins/plugin_error.hpp"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace cles::security {
class checked_file;
} // namespace cles::security

namespace cles::runtime {

/// Which files may be loaded as plugins.
struct plugin_rules {
    bool secured = false; ///< with security: only from these folders and below, and only if no other user can change it
    std::vector<std::filesystem::path> folders{};
};

/// The rules of a configuration: its folders are those in which plugins are searched for.
plugin_rules plugin_rules_of(const config& setup);

/// The file of a plugin. With security, or if its SHA-256 is configured, it is opened once and checked, and exactly the
/// opened file is loaded, even if another one has its name by then.
class plugin_file {
  public:
    /// \param path as written in the configuration \param sha256 small hexadecimal digits; empty: any
    /// \throws plugin_error if the file is refused
    plugin_file(const std::string& path, std::filesystem::path file, const plugin_rules& rules,
                const std::string& sha256);

    /// For messages.
    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
    /// What to pass to the dynamic loader, which identifies libraries by this name first: from then on, the file has to
    /// stay open as long as the process exists (`keep_open`). \throws plugin_error if the opened file has no name here
    [[nodiscard]] std::filesystem::path loader_path(const std::string& path) const;
    /// Whether it was checked.
    [[nodiscard]] bool is_checked() const noexcept { return checked_ != nullptr; }
    void keep_open() const;

  private:
    std::filesystem::path path_;
    std::shared_ptr<const security::checked_file> checked_; // none: not to be checked
};

} // namespace cles::runtime
