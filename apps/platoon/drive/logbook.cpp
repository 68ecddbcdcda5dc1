// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/logbook.hpp"

#include <algorithm>
#include <cstddef>

namespace platoon {
namespace {

// Between two states, by the cubic that fits places and speeds at both.
motion between(const state& a, const state& b, double t) {
    const double h = b.t - a.t;
    const double s = (t - a.t) / h;
    const double slope = (b.x - a.x) / h;
    const double c2 = (3 * slope - 2 * a.v - b.v) * h;
    const double c3 = (a.v + b.v - 2 * slope) * h;
    return {.x = a.x + s * (a.v * h + s * (c2 + s * c3)),
            .v = a.v + s * (2 * c2 + 3 * s * c3) / h,
            .a = a.a + s * (b.a - a.a)};
}

} // namespace

void logbook::add(const std::string& vehicle, const state& told) {
    auto& all = states_[vehicle];
    if (!all.empty() && told.t < all.back().t + closest) {
        return;
    }
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    if (!all.empty() && middle->t < told.t - longest) {
        all.erase(all.begin(), middle);
    }
    all.push_back(told);
}

void logbook::forget(const std::string& vehicle) {
    states_.erase(vehicle);
    ended_.erase(vehicle);
}

void logbook::record_end(const std::string& vehicle, bool left) { ended_.try_emplace(vehicle, left); }

void logbook::record_return(const std::string& vehicle) { ended_.erase(vehicle); }

bool logbook::has_left(const std::string& vehicle) const {
    const auto found = ended_.find(vehicle);
    return found != ended_.end() && found->second;
}

const state* logbook::last(const std::string& vehicle) const {
    const auto found = states_.find(vehicle);
    return found == states_.end() ? nullptr : &found->second.back();
}

role logbook::mode(const std::string& vehicle, double t) const {
    const auto found = states_.find(vehicle);
    if (found == states_.end()) {
        return role::lead;
    }
    const auto next = std::upper_bound(found->second.begin(), found->second.end(), t,
                                       [](double at, const state& s) { return at < s.t; });
    return next == found->second.begin() ? role::lead : (next - 1)->mode;
}

std::optional<motion> logbook::position(const std::string& vehicle, double t) const {
    const auto found = states_.find(vehicle);
    if (found == states_.end() || t < found->second.front().t) {
        return std::nullopt;
    }
    const auto& all = found->second;
    const auto next = std::upper_bound(all.begin(), all.end(), t, [](double at, const state& s) { return at < s.t; });
    const auto& before = *(next - 1);
    if (before.mode == role::merge) {
        return std::nullopt;
    }
    if (next != all.end()) {
        return between(before, *next, t);
    }
    const auto end = ended_.find(vehicle);
    if (end != ended_.end() && end->second) {
        return std::nullopt;
    }
    return end != ended_.end() ? without_driver(before, t)
                               : advance(before.position(), before.u, before.lag, t - before.t);
}

} // namespace platoon
