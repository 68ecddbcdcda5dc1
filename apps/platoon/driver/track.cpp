// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/track.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

constexpr double horizon = 1;         // s: older updates say nothing about the present
constexpr double trend_horizon = 0.3; // s: no command changes at the same pace for long; two missed at 10 Hz
constexpr double drift = 1e-4;        // s/s, by which two clocks may differ in their pace

} // namespace

bool track::receive(const state& heard, double now) {
    const bool restarted = last_ && heard.t < last_->t - horizon;
    if (last_ && !restarted && heard.t <= last_->t) {
        return false; // overtaken by a newer one
    }
    // If nothing is known of the clocks, this shows how much longer an update took than the fastest one.
    const double difference = now - heard.t;
    offset_ = !last_ || restarted ? difference : std::min(difference, offset_ + drift * (now - received_));
    last_ = base_ = heard;
    received_ = now;
    return true;
}

void track::assume(double command, double now) {
    const auto there = at(now);
    base_.t = now - offset();
    base_.x = there.x;
    base_.v = there.v;
    base_.a = there.a;
    base_.u = command;
    base_.j = 0;
}

double track::offset() const {
    // Of updates that arrive at all, the fastest shows the difference within the horizon. Written so that NaN is not
    // used.
    const bool is_shown = difference_ && std::abs(*difference_ - offset_) <= horizon;
    return is_shown ? *difference_ : offset_;
}

double track::age(double now) const { return std::clamp(now - offset() - base_.t, 0.0, horizon); }

double track::command_at(double now) const { return base_.u + base_.j * std::min(age(now), trend_horizon); }

motion track::at(double now) const {
    const double command = command_at(now);
    const double ramp = std::min(age(now), trend_horizon);
    const auto then = advance(base_.position(), (base_.u + command) / 2, base_.lag, ramp);
    return advance(then, command, base_.lag, age(now) - ramp);
}

} // namespace platoon
