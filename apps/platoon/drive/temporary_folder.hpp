// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace platoon {

/// A folder that only this user can read, removed with all that is in it.
class temporary_folder {
  public:
    /// \throws std::system_error
    temporary_folder();
    temporary_folder(const temporary_folder&) = delete;
    temporary_folder& operator=(const temporary_folder&) = delete;
    ~temporary_folder();

    [[nodiscard]] const std::string& path() const noexcept { return path_; }

  private:
    std::string path_;
};

} // namespace platoon
