// SPDX-License-Identifier: BSL-1.0
#include "tracker.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

namespace fmv {
namespace {

constexpr double gate = 6;              ///< pixels from where it is predicted
constexpr double young_gate = 8;        ///< while its velocity is not known
constexpr double usual_interval = 0.04; ///< s, between frames: for larger ones the gates are wider
constexpr double most_wider = 3;
constexpr double least_apart = usual_interval / 2; ///< s: noise over a moment is no velocity
constexpr double alpha = 0.5;
constexpr double beta = 0.2;
constexpr int least_hits = 6;        ///< M
constexpr int window = 8;            ///< N
constexpr double least_path = 5;     ///< pixels that a target has moved when it is confirmed
constexpr int most_missed_young = 2; ///< before it is given up
constexpr int most_missed = 6;       ///< the same, of one that is confirmed
constexpr std::size_t most_tracks = 256;

double distance(point a, point b) { return std::hypot(a.x - b.x, a.y - b.y); }

} // namespace

void tracker::step(std::span<const detection> seen, double seconds) {
    predict(seconds);
    associate(seen, seconds);
    judge();
}

void tracker::predict(double seconds) {
    for (auto& t : all_) {
        t.at.x += t.velocity.x * seconds;
        t.at.y += t.velocity.y * seconds;
        t.history <<= 1U;
        t.age += seconds;
        ++t.looks;
        ++t.missed;
    }
}

// The nearest pairs first; those that are confirmed have the first choice.
void tracker::associate(std::span<const detection> seen, double seconds) {
    const double wider = std::clamp(seconds / usual_interval, 1.0, most_wider);
    const double apart = std::max(seconds, least_apart);
    std::vector<std::tuple<bool, double, std::size_t, std::size_t>> pairs;
    for (std::size_t i = 0; i < all_.size(); ++i) {
        for (std::size_t k = 0; k < seen.size(); ++k) {
            const auto d = distance(all_[i].at, seen[k].centre);
            if (d < (all_[i].looks < 3 ? young_gate : gate) * wider) {
                pairs.emplace_back(!all_[i].confirmed, d, i, k);
            }
        }
    }
    std::sort(pairs.begin(), pairs.end());
    taken_.assign(seen.size(), 0);
    for (const auto& [young, d, i, k] : pairs) {
        auto& t = all_[i];
        if (t.missed == 0 || taken_[k] != 0) {
            continue;
        }
        taken_[k] = 1;
        const point off{seen[k].centre.x - t.at.x, seen[k].centre.y - t.at.y};
        // Of two places the first velocity is the difference; later ones are corrected by a part of what was wrong.
        const double a = t.looks == 1 ? 1 : alpha;
        const double b = t.looks == 1 ? 1 : beta;
        t.at = {t.at.x + a * off.x, t.at.y + a * off.y};
        t.velocity = {t.velocity.x + b * off.x / apart, t.velocity.y + b * off.y / apart};
        t.missed = 0;
        t.history |= 1U;
    }
    // What is near a confirmed target is a part of it that was torn off.
    for (std::size_t k = 0; k < seen.size() && all_.size() < most_tracks; ++k) {
        const auto near = [&](const tracked& t) { return t.confirmed && distance(t.at, seen[k].centre) < gate; };
        if (taken_[k] == 0 && std::none_of(all_.begin(), all_.end(), near)) {
            all_.push_back({.id = next_id_++, .at = seen[k].centre, .first = seen[k].centre});
        }
    }
}

void tracker::judge() {
    for (auto& t : all_) {
        const auto hits = std::popcount(t.history & ((1U << window) - 1));
        t.confirmed = t.confirmed || (hits >= least_hits && distance(t.at, t.first) >= least_path);
    }
    std::erase_if(all_, [](const tracked& t) { return t.missed > (t.confirmed ? most_missed : most_missed_young); });
}

// Of an alpha-beta filter in its steady state (Kalata, "The tracking index", 1984).
double tracker::velocity_deviation(double seconds) {
    return place_deviation * std::sqrt(2 * beta * beta / (alpha * (4 - 2 * alpha - beta))) /
           std::max(seconds, least_apart);
}

std::vector<tracked> tracker::confirmed() const {
    std::vector<tracked> out;
    std::copy_if(all_.begin(), all_.end(), std::back_inserter(out), [](const tracked& t) { return t.confirmed; });
    return out;
}

} // namespace fmv
