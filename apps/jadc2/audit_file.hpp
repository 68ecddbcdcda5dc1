// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace jadc2 {

/// A file to which lines are only ever added; each is on the disk before the program goes on.
class audit_file {
  public:
    /// Opens the file, which is created if it is missing.
    /// \throws std::runtime_error
    explicit audit_file(const std::string& path);
    ~audit_file();
    audit_file(const audit_file&) = delete;
    audit_file& operator=(const audit_file&) = delete;

    /// Once a line could not be written, the file is broken, and no more are.
    void add(const std::string& line);
    [[nodiscard]] bool is_broken() const noexcept { return broken_; }

  private:
    int file_ = -1;
    bool broken_ = false;
};

} // namespace jadc2
