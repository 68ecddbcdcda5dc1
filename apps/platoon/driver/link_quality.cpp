// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/link_quality.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

constexpr double too_old = 0.3;        // s: no command changes at the same pace for longer
constexpr double link_memory = 10;     // s, in which what was counts for 1/e
constexpr double poor_above = 0.85;    // s; 10 % lost independently practically never amount to it, even at 10 Hz
constexpr double good_below = 0.5;     // s
constexpr double full_gap_above = 1.5; // s; more does not count, so that however long it was, it is over after 11 s

} // namespace

void link_quality::step(double now) {
    const double dt = now - stepped_;
    if (dt <= 0) {
        return;
    }
    stepped_ = now;
    const double added = now - received_ > too_old ? dt : 0;
    silence_ = std::min(silence_ * std::exp(-dt / link_memory) + added, full_gap_above);
    poor_ = silence_ > (poor_ ? good_below : poor_above);
}

double link_quality::gap_share() const { return poor_ ? silence_ / full_gap_above : 0; }

} // namespace platoon
