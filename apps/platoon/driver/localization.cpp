// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/localization.hpp"

#include <cmath>
#include <numbers>

namespace platoon {
namespace {

const geo::tangent_plane plane{{.lat = 48.137, .lon = 11.575}};
constexpr double heading = 30 * std::numbers::pi / 180; // from north to east

} // namespace

geo::geographic place_on_road(double x) {
    return plane.to_geographic({.east = x * std::sin(heading), .north = x * std::cos(heading)});
}

double distance_on_road(const geo::geographic& place) {
    const auto at = plane.to_plane(place);
    return at.east * std::sin(heading) + at.north * std::cos(heading);
}

localization to_localization(const state& of, double start_utc) {
    const auto place = place_on_road(of.x);
    return {.mode = of.mode,
            .ahead = of.ahead,
            .lead = of.lead,
            .admits = of.admits,
            .behind = of.behind,
            .utc = start_utc + of.t,
            .lat = place.lat,
            .lon = place.lon,
            .v = of.v,
            .a = of.a,
            .u = of.u,
            .j = of.j,
            .from_leader = of.from_leader,
            .lag = of.lag,
            .brake = of.brake,
            .sent_ns = of.sent_ns};
}

state to_state(const localization& heard, double start_utc) {
    return {.mode = heard.mode,
            .ahead = heard.ahead,
            .lead = heard.lead,
            .admits = heard.admits,
            .behind = heard.behind,
            .t = heard.utc - start_utc,
            .x = distance_on_road({heard.lat, heard.lon}),
            .v = heard.v,
            .a = heard.a,
            .u = heard.u,
            .j = heard.j,
            .from_leader = heard.from_leader,
            .lag = heard.lag,
            .brake = heard.brake,
            .sent_ns = heard.sent_ns};
}

} // namespace platoon
