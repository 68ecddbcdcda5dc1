// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/clock.hpp"

namespace cles::shell {

/// The time as it is, also after the machine was suspended.
class steady_clock final : public core::clock {
  public:
    [[nodiscard]] time_point now() const override { return time_point::clock::now(); }
};

} // namespace cles::shell
