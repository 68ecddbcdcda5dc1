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

state_message reduced(state_message of, dialect how) {
    switch (how) {
    case dialect::current: break;
    case dialect::older:
        of.velocity.reset();
        of.acceleration.reset();
        of.length.reset();
        break;
    case dialect::minimum:
        return {.utc = of.utc, .lat = of.lat, .lon = of.lon, .velocity = of.velocity, .acceleration = of.acceleration};
    }
    return of;
}

state_message to_message(const state& of, double start_utc) {
    const auto place = place_on_road(of.x);
    return {.mode = of.mode,
            .ahead = of.ahead,
            .lead = of.lead,
            .admits = of.admits,
            .behind = of.behind,
            .utc = start_utc + of.t,
            .lat = place.lat,
            .lon = place.lon,
            .velocity = of.v,
            .acceleration = of.a,
            .v = of.v,
            .a = of.a,
            .u = of.u,
            .j = of.j,
            .from_leader = of.from_leader,
            .lag = of.lag,
            .brake = of.brake,
            .length = of.length,
            .sent_ns = of.sent_ns};
}

localization localization_of(const state_message& of) {
    return {.utc = of.utc,
            .lat = of.lat,
            .lon = of.lon,
            .velocity = of.velocity.value_or(of.v.value_or(NAN)),
            .acceleration = of.acceleration.value_or(of.a.value_or(NAN))};
}

state to_state(const state_message& heard, double start_utc) {
    const double acceleration = heard.acceleration.value_or(heard.a.value_or(NAN));
    const state unsaid;
    return {.mode = heard.mode.value_or(role::lead),
            .ahead = heard.ahead.value_or(""),
            .lead = heard.lead.value_or(""),
            .tells_lead = heard.lead && heard.behind,
            .admits = heard.admits.value_or(""),
            .behind = heard.behind.value_or(0),
            .t = heard.utc - start_utc,
            .x = distance_on_road({heard.lat, heard.lon}),
            .v = heard.velocity.value_or(heard.v.value_or(NAN)),
            .a = acceleration,
            .u = heard.u.value_or(acceleration),
            .j = heard.j.value_or(0),
            .from_leader = heard.from_leader,
            .lag = heard.lag.value_or(unsaid.lag),
            .brake = heard.brake.value_or(unsaid.brake),
            .length = heard.length.value_or(unsaid.length),
            .sent_ns = heard.sent_ns.value_or(0)};
}

} // namespace platoon
