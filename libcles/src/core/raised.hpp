// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::core {

/// Holds a flag while it lives, whatever is thrown.
class raised {
  public:
    explicit raised(bool& flag) noexcept : flag_(flag) { flag_ = true; }
    raised(const raised&) = delete;
    raised& operator=(const raised&) = delete;
    ~raised() { flag_ = false; }

  private:
    bool& flag_;
};

} // namespace cles::core
