// SPDX-License-Identifier: BSL-1.0
// All that makes a plugin of them.
#include <cles/plugin.hpp>

#include "odometer.hpp"

CLES_PLUGIN("odometer", "1.0", register_odometer)
