// SPDX-License-Identifier: BSL-1.0
#pragma once

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

} // namespace cles::security
