// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace cles::security {

/// An open file, and whether anybody but this user and root could have changed it or put it there. What is checked is
/// the opened file, so that it cannot be exchanged in between.
class checked_file {
  public:
    /// Opens a regular file to read it. Symbolic links are followed, and checked like folders.
    /// \throws std::runtime_error with a message for people
    explicit checked_file(const std::string& path);
    checked_file(const checked_file&) = delete;
    checked_file& operator=(const checked_file&) = delete;
    ~checked_file();

    [[nodiscard]] int descriptor() const noexcept { return fd_; }
    /// The absolute path without symbolic links.
    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    /// Why another user can change the file or replace it, and what mends that; empty if nobody can.
    [[nodiscard]] const std::string& flaw() const noexcept { return flaw_; }
    /// The SHA-256 (FIPS 180-4) of its content, as 64 hexadecimal digits in small letters.
    /// \throws std::runtime_error with a message for people
    [[nodiscard]] std::string sha256() const;

  private:
    int fd_ = -1;
    std::string path_;
    std::string flaw_;
};

} // namespace cles::security
