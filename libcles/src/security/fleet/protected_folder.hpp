// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/file_protection.hpp"
#include "security/keys/secret.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

/// A folder whose content only its owner and root can change. Names denote files directly in it; symbolic links and
/// everything else that is not a regular file are refused. What is checked is the opened file, so that it cannot be
/// exchanged in between.
///
/// All functions throw `security_error`, which names the file, what is wrong, and the command that mends it.
class protected_folder {
  public:
    enum class access : std::uint8_t {
        secret,  ///< mode 0600: for its owner only
        readable ///< mode 0644: for everybody
    };

    /// Opens the folder, which has to belong to this user or root.
    explicit protected_folder(std::string path);
    /// Creates the folder if it does not exist, with mode 0700, and opens it.
    static protected_folder create(std::string path);

    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] std::string path_of(std::string_view name) const;

    /// Empty if there is no such file.
    [[nodiscard]] std::optional<secret_bytes> read_secret(const std::string& name, std::size_t max_size) const;
    [[nodiscard]] std::optional<std::string> read_text(const std::string& name, std::size_t max_size) const;
    /// The names of the files that end so, sorted.
    [[nodiscard]] std::vector<std::string> names_ending(std::string_view suffix) const;

    /// A text that changes when one of these files changes, appears or disappears. Does not throw.
    [[nodiscard]] std::string state_of(const std::vector<std::string>& names) const;

    /// Writes a file that must not exist yet. It is complete or not there, also after a power failure.
    void create_file(const std::string& name, bytes_view content, access who) const;
    /// Replaces a file, or writes a new one; after a power failure there is the old or the new content.
    void replace_file(const std::string& name, bytes_view content, access who) const;

    /// Waits until no other process of the same user holds this lock. It ends with the returned object.
    [[nodiscard]] descriptor lock(const std::string& name) const;

  private:
    struct opened;

    [[nodiscard]] opened open_file(const std::string& name, access who, std::size_t max_size) const;
    std::string write_temporary(const std::string& name, bytes_view content, access who) const;
    void sync() const;

    std::string path_;
    descriptor folder_;
};

} // namespace cles::security
