// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <optional>

namespace strike {

struct place {
    double x = 0;
    double y = 0;
};

struct meeting {
    place where{};
    double after_s = 0;
};

/// Where something that leaves `from` now, at a constant speed, meets a target that moves on as it does; nowhere, where
/// the target gets away. Velocities are per second. `from` is `height` above the ground.
std::optional<meeting> intercept(place from, double speed, place target, place velocity, double height = 0);

} // namespace strike
