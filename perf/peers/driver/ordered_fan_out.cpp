// SPDX-License-Identifier: BSL-1.0
#include "ordered_fan_out.hpp"

#include "perf/support/bare_socket.hpp"
#include "perf/support/clock.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <stdexcept>

#include <poll.h>

namespace cles::perf::peers {
namespace {

// Subscriptions take effect after some time. A subscriber that is not reached by then has failed.
constexpr std::chrono::milliseconds between_attempts{10};
constexpr int most_attempts = 1000;
// What has not arrived this long after the last publication is lost. The wait takes place only if something is missing.
constexpr std::chrono::milliseconds patience{1000};

} // namespace

void publish_by_order(const std::string& where, const announce& tell,
                      const std::function<void(const publication&)>& publish) {
    const auto orders = listen_on(parse_url("tcp://127.0.0.1:0"));
    tell(to_string(orders.where) + ' ' + where);
    const auto control = accept_from(orders);
    fan_out_order order;
    while (receive_all(control.get(), std::as_writable_bytes(std::span{&order, 1}))) {
        auto next = monotonic_ns();
        for (std::uint64_t i = 0; i < order.updates; ++i) {
            if (order.interval_ns != 0) {
                next += static_cast<std::int64_t>(order.interval_ns);
                wait_until(next);
            }
            publish(publish_sample(i));
        }
        send_all(control.get(), std::array{std::byte{1}});
    }
}

ordered_fan_out::ordered_fan_out(const std::string& announced, std::size_t subscribers, const subscribe& how)
    : inbox_(subscribers) {
    const auto space = announced.find(' ');
    control_ = connect_to(parse_url(announced.substr(0, space)));
    subscriptions_ = how(announced.substr(space + 1), inbox_);
    reach_all();
}

fan_out_tally ordered_fan_out::run(const fan_out_order& what, latency_recorder* record) {
    inbox_.begin(what, record);
    order(what);
    for (bool all_sent = false;;) {
        const auto before = inbox_.look();
        if (before.complete && all_sent) {
            return inbox_.tally();
        }
        if (before.complete) {
            pollfd control{.fd = control_.get(), .events = POLLIN, .revents = 0};
            checked(::poll(&control, 1, -1), "poll");
        } else {
            subscriptions_->take_for(patience, inbox_);
        }
        const bool was_sent = all_sent;
        all_sent = all_sent || published();
        // Datagrams may be lost.
        if (was_sent && inbox_.look().count == before.count) {
            return inbox_.tally();
        }
    }
}

void ordered_fan_out::reach_all() {
    for (int attempt = 0; attempt < most_attempts; ++attempt) {
        order({.binders = 1, .updates = 1});
        pollfd control{.fd = control_.get(), .events = POLLIN, .revents = 0};
        checked(::poll(&control, 1, -1), "poll");
        (void)published();
        subscriptions_->take_for(between_attempts, inbox_);
        if (inbox_.all_reached()) {
            return;
        }
    }
    throw std::runtime_error("not all subscribers were reached");
}

void ordered_fan_out::order(const fan_out_order& what) { send_all(control_.get(), std::as_bytes(std::span{&what, 1})); }

bool ordered_fan_out::published() {
    pollfd control{.fd = control_.get(), .events = POLLIN, .revents = 0};
    if (checked(::poll(&control, 1, 0), "poll") == 0) {
        return false;
    }
    std::array<std::byte, 1> byte{};
    if (!receive_all(control_.get(), byte)) {
        throw std::runtime_error("the publisher closed the connection");
    }
    return true;
}

} // namespace cles::perf::peers
