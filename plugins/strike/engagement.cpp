// SPDX-License-Identifier: BSL-1.0
#include "engagement.hpp"

#include "intercept.hpp"
#include "target_filter.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace strike {
namespace {

// Two vehicles are confused if their plots fit to the track about as well: the likelihoods differ by less than e.
constexpr double ambiguity = 2;

target_filter from_track(const order& what, const geo::tangent_plane& plane) {
    return {plane.to_plane({.lat = what.lat, .lon = what.lon}),
            {.east = what.ve, .north = what.vn},
            what.sigma,
            what.sigma_v};
}

struct sighting {
    double utc = 0;
    plot what{};
};

// The plots that may be those of the target, oldest first, and how little they fit to its track.
struct hypothesis {
    std::vector<sighting> plots{};
    double cost = std::numeric_limits<double>::infinity();
};

void take_nearest(const scan& from, target_filter& target, std::vector<sighting>& found) {
    if (const auto* nearest = nearest_plot(from, target)) {
        target.correct(nearest->at, nearest->noise);
        found.push_back({.utc = from.utc, .what = *nearest});
    }
}

// A plot of one scan, and those that fit to it in newer and older ones. All vehicles leave such plots: so what tells
// that this is the target is how well the first place and the velocity fit to the track.
hypothesis follow(std::span<const scan> scans, std::size_t begin, const plot& first, const target_filter& track,
                  double sigma_v) {
    hypothesis out{.plots = {}, .cost = track.distance(first.at, first.noise)};
    auto target = track;
    target.correct(first.at, first.noise);
    auto later = target;
    for (auto i = begin; i-- > 0;) {
        target.predict(scans[i].utc - scans[i + 1].utc);
        take_nearest(scans[i], target, out.plots);
    }
    std::reverse(out.plots.begin(), out.plots.end());
    out.plots.push_back({.utc = scans[begin].utc, .what = first});
    for (auto i = begin + 1; i < scans.size(); ++i) {
        later.predict(scans[i].utc - scans[i - 1].utc);
        take_nearest(scans[i], later, out.plots);
    }
    const double east = (target.velocity().east - track.velocity().east) / sigma_v;
    const double north = (target.velocity().north - track.velocity().north) / sigma_v;
    out.cost += east * east + north * north;
    return out;
}

bool are_same(const sighting& a, const sighting& b) {
    return a.utc == b.utc && a.what.at.east == b.what.at.east && a.what.at.north == b.what.at.north;
}

// Whether both are about the same vehicle: they share most of their plots.
bool are_same(const hypothesis& a, const hypothesis& b) {
    const auto shared = std::count_if(a.plots.begin(), a.plots.end(), [&b](const auto& one) {
        return std::any_of(b.plots.begin(), b.plots.end(), [&one](const auto& other) { return are_same(one, other); });
    });
    return static_cast<std::size_t>(shared) * 2 > std::min(a.plots.size(), b.plots.size());
}

struct choice {
    std::vector<sighting> plots{};
    double cost = 0;
    bool ambiguous = false;
};

choice choose(std::vector<hypothesis> from) {
    const auto best =
        std::min_element(from.begin(), from.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; });
    if (best == from.end()) {
        return {};
    }
    const bool ambiguous = std::any_of(from.begin(), from.end(), [&best](const auto& other) {
        return other.cost < best->cost + ambiguity && !are_same(*best, other);
    });
    return {.plots = std::move(best->plots), .cost = best->cost, .ambiguous = ambiguous};
}

// The plots of the target, oldest first. It begins with the newest scan, which is next to the time of the track, where
// the target is known best; and goes on with older ones, because the target may have been missed. There may be several
// vehicles near the track. What has plots in less than half of the scans is false, or moves differently.
choice plots_of(std::span<const scan> scans, const order& what, const target_filter& track) {
    constexpr std::size_t enough = 3;
    std::vector<hypothesis> likely;
    for (std::size_t tried = 0; tried < scans.size() && (tried < enough || likely.empty()); ++tried) {
        const auto begin = scans.size() - 1 - tried;
        auto target = track;
        target.predict(scans[begin].utc - what.utc);
        for (const auto& first : scans[begin].plots) {
            if (target.distance(first.at, first.noise) < gate) {
                auto found = follow(scans, begin, first, target, what.sigma_v);
                if (found.plots.size() * 2 > scans.size()) {
                    likely.push_back(std::move(found));
                }
            }
        }
    }
    return choose(std::move(likely));
}

} // namespace

aircraft_state default_state(std::uint64_t scans) {
    const geo::tangent_plane plane{geo::traffic::origin};
    return {.at = plane.to_geographic({.east = -800, .north = 0}), .height = 600, .speed = 400, .scans = scans};
}

const plot* nearest_plot(const scan& from, const target_filter& target) {
    const plot* nearest = nullptr;
    double least = gate;
    for (const auto& each : from.plots) {
        if (const double d = target.distance(each.at, each.noise); d < least) {
            least = d;
            nearest = &each;
        }
    }
    return nearest;
}

fused_target fuse(const order& what, double now, const aircraft_state& own, own_sensor& sensor) {
    auto target = from_track(what, sensor.plane());
    const auto chosen = plots_of(sensor.last(own.scans, now), what, target);
    double utc = what.utc;
    for (const auto& each : chosen.plots) {
        target.predict(each.utc - std::exchange(utc, each.utc));
        target.correct(each.what.at, each.what.noise);
    }
    target.predict(now - utc);
    return {.target = target, .plots = chosen.plots.size(), .misfit = chosen.cost, .ambiguous = chosen.ambiguous};
}

std::optional<aim> aim_at(const fused_target& what, const aircraft_state& own, const geo::tangent_plane& plane) {
    auto target = what.target;
    const auto at = target.at();
    const auto moving = target.velocity();
    const auto meets = intercept({0, 0}, own.speed, {at.east, at.north}, {moving.east, moving.north}, own.height);
    if (!meets) {
        return std::nullopt;
    }
    target.predict(meets->after_s);
    return aim{.at = plane.to_geographic({.east = meets->where.x, .north = meets->where.y}),
               .after_s = meets->after_s,
               .sigma = target.deviation(),
               .plots = what.plots};
}

std::optional<aim> engage(const order& what, double now, const aircraft_state& own, own_sensor& sensor) {
    return aim_at(fuse(what, now, own, sensor), own, sensor.plane());
}

} // namespace strike
