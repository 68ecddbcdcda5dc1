// SPDX-License-Identifier: BSL-1.0
#include "release_rules.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

namespace strike {
namespace {

// Eight standard deviations: what fits worse to the track is another vehicle. A track can be nearly as wrong as that
// while its vehicle leaves the picture, because the middle of the part that is still in it moves more slowly.
constexpr double unlikely = 64;

std::string number(double value, int digits = 1) {
    std::array<char, 400> text{}; // the greatest double has 309 digits
    std::snprintf(text.data(), text.size(), "%.*f", digits, value);
    return text.data();
}

decision refuse(std::string why) { return {.kind = verdict::refused, .why = std::move(why), .at = {}, .target = {}}; }

decision fail(std::string why) { return {.kind = verdict::failed, .why = std::move(why), .at = {}, .target = {}}; }

// Why it is no order; nothing if it is one.
std::string mistake_in(const order& what, double now) {
    if (what.id.empty() || what.id.size() > 64) {
        return "id: 1 to 64 characters";
    }
    for (const double each : {what.ve, what.vn, what.utc, what.until}) {
        if (!std::isfinite(each)) {
            return "ve, vn, utc and until: numbers";
        }
    }
    if (!(std::abs(what.lat) <= 89 && std::abs(what.lon) <= 180)) {
        return "lat and lon: degrees, -89 to 89 and -180 to 180";
    }
    if (!(what.sigma > 0 && what.sigma <= 1000 && what.sigma_v > 0 && what.sigma_v <= 1000)) {
        return "sigma and sigma_v: more than 0, 1000 at most";
    }
    if (what.until - now > longest_order_s) {
        return "until: " + number(longest_order_s, 0) + " s from now at most";
    }
    return {};
}

// Why the track says too little; nothing if it says enough.
std::string doubt_in(const order& what, double now, const aircraft& own) {
    if (now >= what.until) {
        return "the order ended " + number(now - what.until, 3) + " s ago";
    }
    const double age = now - what.utc;
    if (std::abs(age) > own.limits.oldest_s) {
        return "the track is " + number(age) + " s old: " + number(own.limits.oldest_s) + " at most";
    }
    if (what.utc < own.no_track_before) {
        return "the track is older than the start of this aircraft, which has no ledger";
    }
    if (const double wide = std::hypot(what.sigma, what.sigma_v * age); wide > own.limits.widest_m) {
        return "the target's place is known to " + number(wide) + " m: " + number(own.limits.widest_m) + " at most";
    }
    return {};
}

double distance_to(const geo::geographic& place, const aircraft& own) {
    const auto at = own.sensor.plane().to_plane(place);
    return std::hypot(at.east, at.north, own.state.height);
}

std::string too_far(double distance, const aircraft& own) {
    return distance > own.limits.range_m
               ? "the target is " + number(distance, 0) + " m away: " + number(own.limits.range_m, 0) + " at most"
               : std::string{};
}

void follow_engaged(double now, aircraft& own) {
    const auto count =
        own.state.scans == 0 ? 0 : std::max(own.engaged.scans_needed(now), own.waiting.scans_needed(now));
    // At least as many as are needed next, because others are not kept.
    const auto scans = count == 0 ? std::vector<scan>{} : own.sensor.last(std::max(count, own.state.scans), now);
    own.engaged.follow(scans, now);
    own.waiting.follow(scans, now);
}

} // namespace

decision decide(const order& what, double now, aircraft& own) {
    if (auto mistake = mistake_in(what, now); !mistake.empty()) {
        return {.kind = verdict::wrong, .why = std::move(mistake), .at = {}, .target = {}};
    }
    if (own.weapons.has_carried_out(what.id)) {
        return fail("the order " + what.id + " has been carried out already");
    }
    if (auto doubt = doubt_in(what, now, own); !doubt.empty()) {
        return refuse(std::move(doubt));
    }
    // Before the sensor is asked: far away, its plane is inexact.
    if (auto distant = too_far(distance_to({.lat = what.lat, .lon = what.lon}, own), own); !distant.empty()) {
        return refuse(std::move(distant));
    }
    follow_engaged(now, own);
    const auto target = fuse(what, now, own.state, own.sensor);
    if (!what.drill.value_or(false)) {
        if (own.state.scans != 0 && (target.plots == 0 || target.misfit > unlikely)) {
            return refuse("its own sensor sees no target there");
        }
        if (target.ambiguous) {
            return refuse("its own sensor sees several targets there");
        }
        if (const auto before = own.engaged.find(target.target, now); before && !what.again.value_or(false)) {
            return fail("the target has been attacked by order " + *before + ": \"again\":true attacks it again");
        }
    }
    const auto aimed = aim_at(target, own.state, own.sensor.plane());
    if (!aimed) {
        return refuse("the target is too fast");
    }
    if (auto distant = too_far(distance_to(aimed->at, own), own); !distant.empty()) {
        return refuse(std::move(distant));
    }
    if (aimed->after_s > own.limits.flight_s) {
        return refuse("the weapon would fly for " + number(aimed->after_s) + " s: " + number(own.limits.flight_s) +
                      " at most");
    }
    if (own.weapons.left() == 0) {
        return refuse("no weapon is left");
    }
    return {.kind = verdict::release, .why = {}, .at = *aimed, .target = target.target};
}

void hold(const order& what, const decision& by, double now, aircraft& own) {
    own.waiting.add(what.id, by.target.value(), now);
}

std::optional<order> follow_up(const order& what, double now, aircraft& own) {
    follow_engaged(now, own);
    const auto target = own.waiting.at(what.id, now);
    if (!target) {
        return std::nullopt;
    }
    const auto at = own.sensor.plane().to_geographic(target->at());
    auto out = what;
    out.lat = at.lat;
    out.lon = at.lon;
    out.ve = target->velocity().east;
    out.vn = target->velocity().north;
    out.sigma = target->deviation();
    out.utc = now;
    return out;
}

void release(const order& what, const decision& by, double now, aircraft& own) {
    own.weapons.release(what.id);
    own.engaged.add(what.id, by.target.value(), now);
}

void remember(const order& what, double released_utc, aircraft& own) {
    own.engaged.add(what.id, fuse(what, released_utc, own.state, own.sensor).target, released_utc);
}

} // namespace strike
