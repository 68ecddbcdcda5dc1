// SPDX-License-Identifier: BSL-1.0
#include "serve/demo_node.hpp"

#include <cles/types.hpp>

#include "serve/demo_tasks.hpp"
#include "system/system_time.hpp"

#include <boost/describe.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tool {
namespace {

/// The position and the motion of a vehicle, which the vehicles of a platoon exchange (paper, section 4.1).
struct localization {
    double utc = 0;
    double lat = 0;
    double lon = 0;
    double velocity = 0;
    double acceleration = 0;
};
BOOST_DESCRIBE_STRUCT(localization, (), (utc, lat, lon, velocity, acceleration))
CLES_FIELD(localization, utc, "s", "since 1970")
CLES_FIELD(localization, lat, "deg", "latitude, WGS 84", -90, 90)
CLES_FIELD(localization, lon, "deg", "longitude, WGS 84", -180, 180)
CLES_FIELD(localization, velocity, "m/s")
CLES_FIELD(localization, acceleration, "m/s²")

constexpr double centre_lat = 48.2208;
constexpr double centre_lon = 11.7248;
constexpr double radius = 640;    // m
constexpr double mean_speed = 25; // m/s
constexpr double swing = 4;       // m/s around the mean
constexpr double swing_period = 40;
constexpr double metres_per_degree = 111'320;

double rounded_to(double value, double steps_per_unit) { return std::round(value * steps_per_unit) / steps_per_unit; }

// A vehicle on a circular test track with varying speed. Rounded to what a receiver can distinguish, so that its text
// is short: milliseconds, 0.1 m, cm/s.
localization vehicle_at(double utc) {
    constexpr double pulse = 2 * std::numbers::pi / swing_period;
    const double distance = mean_speed * utc - swing / pulse * std::cos(pulse * utc);
    const double angle = distance / radius;
    const double north = radius * std::sin(angle);
    const double east = radius * std::cos(angle);
    return {
        .utc = rounded_to(utc, 1e3),
        .lat = rounded_to(centre_lat + north / metres_per_degree, 1e6),
        .lon = rounded_to(centre_lon + east / (metres_per_degree * std::cos(centre_lat * std::numbers::pi / 180)), 1e6),
        .velocity = rounded_to(mean_speed + swing * std::sin(pulse * utc), 1e2),
        .acceleration = rounded_to(swing * pulse * std::cos(pulse * utc), 1e2),
    };
}

localization current_localization() {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return vehicle_at(std::chrono::duration<double>{now}.count());
}

void check_no_parameters(const cles::request& r) {
    if (!r.parameters().empty()) {
        throw cles::error(cles::errc::bad_request, "localization takes no parameters");
    }
}

} // namespace

demo_node::demo_node(cles::service& by, double rate)
    : service_(by), timer_(by.get_executor()), next_(std::chrono::steady_clock::now()) {
    register_localization();
    register_demo_tasks(service_);
    sysinfo::register_system_time(service_);
    if (rate > 0) {
        period_ = std::chrono::nanoseconds{std::llround(1e9 / rate)};
        publish();
    }
}

void demo_node::stop() {
    stopped_ = true; // a timer that has already expired cannot be cancelled
    timer_.cancel();
}

void demo_node::register_localization() {
    const cles::task_info info{.description = "The position of the vehicle: utc s, lat and lon degrees, velocity m/s, "
                                              "acceleration m/s2",
                               .idempotent = true};
    cles::typed_registrar tasks{service_};
    tasks.on_pull(
        "localization",
        [](const cles::request& r) {
            check_no_parameters(r);
            return current_localization();
        },
        info);
    tasks.on_bind<localization>("localization", check_no_parameters, info);
}

void demo_node::publish() {
    service_.update("localization", current_localization());
    // At fixed times, whatever this function takes; missed times are skipped.
    next_ = std::max(next_ + period_, std::chrono::steady_clock::now());
    timer_.expires_at(next_);
    timer_.async_wait([this](boost::system::error_code code) {
        if (!code && !stopped_) {
            publish();
        }
    });
}

} // namespace tool
