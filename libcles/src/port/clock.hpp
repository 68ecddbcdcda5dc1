// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

namespace cles::core {

/// The time, if no caller passes it in, as when a handler replies. Tests set it.
class clock {
  public:
    clock() = default;
    clock(const clock&) = delete;
    clock& operator=(const clock&) = delete;
    virtual ~clock() = default;
    [[nodiscard]] virtual time_point now() const = 0;
};

} // namespace cles::core
