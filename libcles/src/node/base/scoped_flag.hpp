// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <utility>

namespace cles::core {

/// Sets a flag for its lifetime, whatever is thrown; then the flag has its previous value.
class scoped_flag {
  public:
    explicit scoped_flag(bool& flag) noexcept : flag_(flag), before_(std::exchange(flag, true)) {}
    scoped_flag(const scoped_flag&) = delete;
    scoped_flag& operator=(const scoped_flag&) = delete;
    ~scoped_flag() { flag_ = before_; }

  private:
    bool& flag_;
    bool before_;
};

} // namespace cles::core
