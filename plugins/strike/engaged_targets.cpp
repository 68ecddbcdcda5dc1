// SPDX-License-Identifier: BSL-1.0
#include "engaged_targets.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace strike {
namespace {

constexpr double most_scans = 600; // they take milliseconds on the I/O thread

} // namespace

void engaged_targets::add(std::string order, const target_filter& target, double now) {
    all_.push_back({.order = std::move(order), .target = target, .utc = now, .seen_utc = now});
}

std::uint64_t engaged_targets::scans_needed(double now) const {
    double longest = 0;
    for (const auto& each : all_) {
        longest = std::max(longest, now - each.utc);
    }
    return static_cast<std::uint64_t>(std::min(most_scans, std::ceil(longest / own_sensor::interval)));
}

void engaged_targets::follow(const std::vector<scan>& scans, double now) {
    for (auto& each : all_) {
        for (const auto& from : scans) {
            if (from.utc <= each.utc || from.utc - each.seen_utc > lost_s) {
                continue;
            }
            each.target.predict(from.utc - std::exchange(each.utc, from.utc));
            if (const auto* nearest = nearest_plot(from, each.target)) {
                each.target.correct(nearest->at, nearest->noise);
                each.seen_utc = from.utc;
            }
        }
    }
    std::erase_if(all_, [now](const auto& each) { return now - each.seen_utc > lost_s; });
}

void engaged_targets::remove(const std::string& order) {
    std::erase_if(all_, [&order](const auto& each) { return each.order == order; });
}

std::optional<target_filter> engaged_targets::at(const std::string& order, double now) const {
    for (const auto& each : all_) {
        if (each.order == order) {
            auto there = each.target;
            there.predict(now - each.utc);
            return there;
        }
    }
    return std::nullopt;
}

std::optional<std::string> engaged_targets::find(const target_filter& target, double now) const {
    const double variance = target.deviation() * target.deviation();
    for (const auto& each : all_) {
        auto there = each.target;
        there.predict(now - each.utc);
        if (there.distance(target.at(), {.ee = variance, .en = 0, .nn = variance}) < gate) {
            return each.order;
        }
    }
    return std::nullopt;
}

} // namespace strike
