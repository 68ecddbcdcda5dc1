// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

struct stat;

namespace cles::security {

/// An open file or folder.
class descriptor {
  public:
    descriptor() = default;
    explicit descriptor(int fd) noexcept : fd_(fd) {}
    descriptor(descriptor&& other) noexcept;
    descriptor& operator=(descriptor&& other) noexcept;
    ~descriptor();

    [[nodiscard]] int get() const noexcept { return fd_; }
    /// From now on somebody else closes it.
    [[nodiscard]] int release() noexcept;
    [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }

  private:
    int fd_ = -1;
};

/// \param code that of `errno` \throws security_error
[[noreturn]] void fail_with(int code, const std::string& what);

/// \param path for the message \throws security_error
struct stat status_of(const descriptor& file, const std::string& path);

} // namespace cles::security
