// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/pace.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {

unsigned decisions_per_update(double hz) { return static_cast<unsigned>(std::ceil(100 / hz)); }

unsigned decisions_per_echo(const radar_setup& radar, double hz) {
    return std::max(1U, static_cast<unsigned>(std::lround(radar.period * hz * decisions_per_update(hz))));
}

double send_offset(std::size_t i, std::size_t n, double hz) {
    return static_cast<double>(i) / static_cast<double>(n) / hz;
}

} // namespace platoon
