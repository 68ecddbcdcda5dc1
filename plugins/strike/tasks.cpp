// SPDX-License-Identifier: BSL-1.0
#include "tasks.hpp"

#include <cles/setting_error.hpp>

#include "engagement.hpp"
#include "magazine.hpp"
#include "order.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace strike {
namespace {

using cles::errc;
using cles::error;
using steady = std::chrono::steady_clock;
using milliseconds = std::chrono::duration<double, std::milli>;

struct inventory {
    std::uint64_t left = 0;
    std::vector<std::string> orders{};
};
BOOST_DESCRIBE_STRUCT(inventory, (), (left, orders))

aircraft_state state_of(const settings& wanted) {
    const auto usual = default_state();
    return {.at = {.lat = wanted.lat.value_or(usual.at.lat), .lon = wanted.lon.value_or(usual.at.lon)},
            .height = wanted.height.value_or(usual.height),
            .speed = wanted.speed.value_or(usual.speed),
            .scans = wanted.scans.value_or(usual.scans)};
}

struct aircraft {
    explicit aircraft(const settings& wanted)
        : weapons(wanted.weapons.value_or(4)), oldest_s(wanted.oldest_s.value_or(2)), state(state_of(wanted)),
          sensor(wanted.seed.value_or(1), state.at) {}

    std::mutex lock; // in an application, a test or a daemon: any thread calls
    magazine weapons;
    double oldest_s;
    aircraft_state state;
    own_sensor sensor;
};

double utc_now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

void check(const order& what, double age, const aircraft& own) {
    if (what.id.empty() || what.id.size() > 64) {
        throw error(errc::bad_request, "id: 1 to 64 characters");
    }
    for (const double number : {what.ve, what.vn, what.utc}) {
        if (!std::isfinite(number)) {
            throw error(errc::bad_request, "ve, vn and utc: numbers");
        }
    }
    if (!(std::abs(what.lat) <= 89 && std::abs(what.lon) <= 180)) {
        throw error(errc::bad_request, "lat and lon: degrees, -89 to 89 and -180 to 180");
    }
    if (!(what.sigma > 0 && what.sigma <= 1000 && what.sigma_v > 0 && what.sigma_v <= 1000)) {
        throw error(errc::bad_request, "sigma and sigma_v: more than 0, 1000 at most");
    }
    if (std::abs(age) > own.oldest_s) {
        throw error(errc::failed,
                    "the track is " + std::to_string(age) + " s old: " + std::to_string(own.oldest_s) + " at most");
    }
    if (own.weapons.has_carried_out(what.id)) {
        throw error(errc::failed, "the order " + what.id + " has been carried out already");
    }
}

void carry_out(const cles::request& asked, const cles::responder& answer, aircraft& own) {
    const auto begun = steady::now();
    const auto what = asked.as<order>();
    const std::scoped_lock guard{own.lock};
    const double now = utc_now();
    const double age = now - what.utc;
    check(what, age, own);
    const auto hit = engage(what, now, own.state, own.sensor);
    if (!hit) {
        throw error(errc::failed, "the target is too fast");
    }
    if (own.weapons.left() == 0) {
        answer.refuse("no weapon is left", std::chrono::hours{1}); // another aircraft may have one
        return;
    }
    if (!what.drill.value_or(false)) {
        own.weapons.release(what.id);
    }
    answer.done(outcome{.node = std::string{asked.node()},
                        .order = what.id,
                        .aim_lat = hit->at.lat,
                        .aim_lon = hit->at.lon,
                        .sigma = hit->sigma,
                        .plots = hit->plots,
                        .impact_utc = now + hit->after_s,
                        .flight_s = hit->after_s,
                        .left = own.weapons.left(),
                        .run_ms = milliseconds{steady::now() - begun}.count()});
}

void require(bool fits, const char* key, const char* what) {
    if (!fits) {
        throw cles::setting_error(key, what);
    }
}

} // namespace

void settings::check() const {
    require(weapons.value_or(4) <= 1000, "weapons", "weapons: 1000 at most");
    require(std::abs(lat.value_or(0)) <= 89, "lat", "lat: -89 to 89 degrees");
    require(std::abs(lon.value_or(0)) <= 180, "lon", "lon: -180 to 180 degrees");
    require(height.value_or(0) >= 0 && height.value_or(0) <= 50'000, "height", "height: 0 to 50000 m");
    require(scans.value_or(0) <= 30, "scans", "scans: 30 at most"); // the search takes its time on the I/O thread
    require(speed.value_or(400) > 0 && std::isfinite(speed.value_or(400)), "speed", "speed: more than 0");
    require(oldest_s.value_or(2) > 0 && std::isfinite(oldest_s.value_or(2)), "oldest_s", "oldest_s: more than 0");
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    wanted.check();
    const auto own = std::make_shared<aircraft>(wanted);
    to.on_pull("strike",
               [own] {
                   const std::scoped_lock guard{own->lock};
                   return inventory{own->weapons.left(), {own->weapons.orders().begin(), own->weapons.orders().end()}};
               },
               {.description = "Weapons that are left, and orders that were carried out",
                .idempotent = true,
                .inline_ok = true});
    to.on_delegate("strike",
                   [own](const cles::request& asked, const cles::responder& answer) { carry_out(asked, answer, *own); },
                   {.description = "Strikes a target: where it was, when, and how it moves",
                    .inline_ok = true,
                    .local = true, // the weapons are those of this node
                    .must_be_signed = wanted.must_be_signed.value_or(false)});
}

} // namespace strike
