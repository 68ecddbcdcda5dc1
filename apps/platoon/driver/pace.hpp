// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/radar.hpp"

#include <cstddef>

namespace platoon {

/// How often a vehicle decides between two of its updates, so that it does so at least 100 times a second.
unsigned decisions_per_update(double hz);
/// After how many decisions the radar measures.
unsigned decisions_per_echo(const radar_setup& radar, double hz);
/// The offset in a period at which vehicle i of n sends, so that not all send at once.
double send_offset(std::size_t i, std::size_t n, double hz);

} // namespace platoon
