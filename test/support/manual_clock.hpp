// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "port/environment.hpp"

#include <chrono>

namespace cles::test {

/// Time that only a test advances.
class manual_clock final : public core::clock {
  public:
    [[nodiscard]] time_point now() const override { return now_; }
    void advance(std::chrono::nanoseconds by) { now_ += by; }

  private:
    time_point now_{std::chrono::hours{1}};
};

} // namespace cles::test
