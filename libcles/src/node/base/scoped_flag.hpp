// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::core {

/// Sets a flag for its lifetime, whatever is thrown.
class scoped_flag {
  public:
    explicit scoped_flag(bool& flag) noexcept : flag_(flag) { flag_ = true; }
    scoped_flag(const scoped_flag&) = delete;
    scoped_flag& operator=(const scoped_flag&) = delete;
    ~scoped_flag() { flag_ = false; }

  private:
    bool& flag_;
};

} // namespace cles::core
