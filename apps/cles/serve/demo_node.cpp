// SPDX-License-Identifier: BSL-1.0
#include "serve/demo_node.hpp"

#include "serve/demo_tasks.hpp"
#include "serve/vehicle.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tool {
namespace {

localization here() {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return vehicle_at(std::chrono::duration<double>{now}.count());
}

void refuse_parameters(const cles::request& r) {
    if (!r.parameters().empty()) {
        throw cles::error(cles::errc::bad_request, "localization takes no parameters");
    }
}

} // namespace

play_node::play_node(boost::asio::io_context& io, cles::service_options options, double rate)
    : service_(io, std::move(options)), timer_(io), next_(std::chrono::steady_clock::now()) {
    register_localization();
    register_play_tasks(service_);
    if (rate > 0) {
        period_ = std::chrono::nanoseconds{std::llround(1e9 / rate)};
        publish();
    }
}

void play_node::stop() {
    stopped_ = true; // a timer that has expired already cannot be cancelled
    timer_.cancel();
    service_.stop();
}

void play_node::register_localization() {
    const cles::task_info about{.description = "Where the vehicle is: utc s, lat and lon degrees, velocity m/s, "
                                               "acceleration m/s2",
                                .idempotent = true};
    service_.on_pull(
        "localization",
        [](const cles::request& r) {
            refuse_parameters(r);
            return here();
        },
        about);
    service_.on_bind("localization", refuse_parameters, about);
}

void play_node::publish() {
    service_.update("localization", here());
    // By the beat of the clock, not of this function; a beat that was slept through is left out.
    next_ = std::max(next_ + period_, std::chrono::steady_clock::now());
    timer_.expires_at(next_);
    timer_.async_wait([this](boost::system::error_code code) {
        if (!code && !stopped_) {
            publish();
        }
    });
}

} // namespace tool
