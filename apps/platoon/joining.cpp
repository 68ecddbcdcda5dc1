// SPDX-License-Identifier: BSL-1.0
// How a vehicle finds the end of a platoon, and is let in.
#include "vehicle_node.hpp"

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <algorithm>

namespace platoon {

namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr double approach = 40;     // m from the last vehicle, where it begins
constexpr double one_at_a_time = 5; // s for which one that was let in is waited for
constexpr double asks_for = 2 * one_at_a_time;

/// The last of a platoon: whom nobody follows, and of several such the one that is farthest behind.
std::string last_of(const std::map<std::string, state>& heard) {
    std::string last;
    for (const auto& [name, at] : heard) {
        const bool followed = std::any_of(heard.begin(), heard.end(),
                                          [&name = name](const auto& other) { return other.second.ahead == name; });
        if (!followed && (last.empty() || at.x < heard.at(last).x)) {
            last = name;
        }
    }
    return last;
}

} // namespace

void vehicle_node::be_followed(const applicant& who) {
    if (!driver_ || left_at_) {
        throw cles::error(cles::errc::busy, report_.vehicle + " is about to leave, or not there yet");
    }
    if (!follower_.empty() && follower_ != who.name && now() < followed_at_ + one_at_a_time) {
        throw cles::error(cles::errc::busy, follower_ + " joins behind " + report_.vehicle + " just now");
    }
    follower_ = who.name;
    followed_at_ = now();
}

asio::awaitable<std::map<std::string, state>> vehicle_node::listen() {
    std::map<std::string, state> heard;
    auto feed = co_await service_.async_bind<state>("all:state");
    asio::steady_timer enough{io_, 300ms + std::chrono::milliseconds{static_cast<int>(3000 / options_.setup.hz)}};
    enough.async_wait([&feed](boost::system::error_code failed) {
        if (!failed) {
            feed.close();
        }
    });
    try {
        for (;;) {
            const auto item = co_await feed.async_next();
            if (item.has_value()) {
                heard[item.publisher] = item.value;
            }
        }
    } catch (const cles::error& e) {
        if (e.code() != cles::errc::cancelled) {
            throw;
        }
    }
    co_return heard;
}

asio::awaitable<void> vehicle_node::join() {
    const applicant self{options_.setup.name};
    for (const double until = now() + asks_for;;) {
        const auto heard = co_await listen();
        if (heard.empty()) {
            throw cles::error(cles::errc::no_target, "nobody leads: no vehicle is heard in the group " +
                                                         options_.group.group + ":" +
                                                         std::to_string(options_.group.port));
        }
        if (heard.contains(self.name)) {
            throw cles::error(cles::errc::invalid_name, "a vehicle named " + self.name + " is on the road already");
        }
        const auto last = last_of(heard);
        std::optional<cles::error> refused;
        try {
            co_await service_.async_push(last + ":join", self);
        } catch (const cles::error& e) {
            refused = e;
        }
        if (!refused) {
            auto setup = options_.setup;
            const auto& at = heard.at(last);
            setup.ahead = last;
            setup.start = {at.x - approach, at.v, 0};
            begin(setup);
            co_return;
        }
        if (now() >= until) {
            throw cles::error(refused->code(), refused->message());
        }
    }
}

} // namespace platoon
