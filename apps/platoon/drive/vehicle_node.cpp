// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/vehicle_node.hpp"

#include "client/member_key.hpp"
#include "output/log_line.hpp"
#include "platoon/drive/next_state.hpp"
#include "platoon/simulation/simulation.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <memory>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>

namespace platoon {

namespace asio = boost::asio;
using namespace std::chrono_literals;
using steady = std::chrono::steady_clock;

namespace {

constexpr double join_timeout = 10; // s
constexpr auto clock_deadline = 500ms;

std::string reason_of(const std::exception_ptr& failure) {
    try {
        std::rethrow_exception(failure);
    } catch (const std::exception& e) {
        return e.what();
    }
}

// The IPv4 address of an interface of this host; 127.0.0.1 if it is loopback, or has none.
std::string own_address(const std::string& interface_name) {
    ifaddrs* first = nullptr;
    const bool told = ::getifaddrs(&first) == 0;
    const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all{first, &::freeifaddrs};
    for (const auto* each = told ? first : nullptr; each != nullptr; each = each->ifa_next) {
        std::array<char, INET_ADDRSTRLEN> text{};
        if (interface_name == each->ifa_name && (each->ifa_flags & IFF_LOOPBACK) == 0 && each->ifa_addr != nullptr &&
            each->ifa_addr->sa_family == AF_INET) {
            const auto* at = reinterpret_cast<const sockaddr_in*>(each->ifa_addr);
            ::inet_ntop(AF_INET, &at->sin_addr, text.data(), text.size());
            return text.data();
        }
    }
    return "127.0.0.1";
}

// Its address on each interface, so that nodes on that network can reach it.
std::vector<std::string> listen_urls(const cles::multicast_options& group, const std::string& scheme) {
    std::vector<std::string> urls;
    for (const auto& interface : cles::interfaces_of(group)) {
        urls.push_back(scheme + "://" + own_address(interface) + ":0");
    }
    return urls;
}

cles::service_options options_of(const vehicle_options& vehicle) {
    const bool secured = !vehicle.keys.empty();
    cles::service_options out;
    if (secured) {
        tool::use_member_key(out, vehicle.keys);
    }
    out.name = vehicle.setup.driving.name;
    out.listen = listen_urls(vehicle.group, secured ? "tls" : "tcp");
    if (!vehicle.exchange.empty()) {
        out.listen.push_back(exchange_url(vehicle.exchange, vehicle.setup.driving.name));
    }
    out.insecure = vehicle.insecure;
    out.multicast = vehicle.group;
    return out;
}

} // namespace

std::int64_t monotonic_ns() { return std::chrono::nanoseconds{steady::now().time_since_epoch()}.count(); }

double utc_at(std::int64_t monotonic) {
    const std::chrono::duration<double> utc = std::chrono::system_clock::now().time_since_epoch();
    return utc.count() + static_cast<double>(monotonic - monotonic_ns()) * 1e-9;
}

std::string exchange_url(const std::string& folder, const std::string& vehicle) {
    return "unix://" + folder + "/" + vehicle;
}

vehicle_node::vehicle_node(vehicle_options options)
    : options_(std::move(options)), service_(io_, options_of(options_)), signals_(io_, SIGTERM, SIGINT),
      vehicle_(options_.setup),
      log_(tool::stream::err, [](std::uint64_t count) { return tool::dropped_text(count) + "\n"; }) {
    vehicle_.on_note = [this](const event& what) {
        std::array<char, 32> time{};
        std::snprintf(time.data(), time.size(), "%8.3f s  ", what.t);
        log_.write(time.data() + what.vehicle + "  " + what.mode + ": " + what.why + "\n");
    };
    service_.on_bind("state", {.description = "Its mode, position, speed and acceleration",
                               .must_be_signed = !options_.keys.empty()});
    service_.on_bind("localization", {.description = "Its position, speed and acceleration alone",
                                      .must_be_signed = !options_.keys.empty()});
    service_.on_push("join",
                     [this](const join_request& who) {
                         const auto refused = vehicle_.accept_follower(who, now());
                         if (!refused.empty()) {
                             throw cles::error(cles::errc::busy, refused);
                         }
                     },
                     {.description = "Follow this vehicle, the last one", .parameters = {}});
    service_.on_push("split",
                     [this] {
                         const auto refused = vehicle_.split();
                         if (!refused.empty()) {
                             throw cles::error(cles::errc::unavailable, refused);
                         }
                     },
                     {.description = "Lead those behind, at a distance", .parameters = {}, .idempotent = true});
    service_.on_pull("clock", [this] { return clock_reading{.utc = vehicle_.utc(now())}; },
                     {.description = "The time by its clock", .parameters = {}, .idempotent = true});
    service_.on_push("leave", [this] { vehicle_.leave(now()); },
                     {.description = "Leave the platoon", .parameters = {}, .idempotent = true});
}

double vehicle_node::now() const { return static_cast<double>(monotonic_ns() - options_.start_ns) * 1e-9; }

void vehicle_node::end() {
    service_.stop();
    io_.stop();
}

vehicle_report vehicle_node::run() {
    signals_.async_wait([this](boost::system::error_code, int) { end(); });
    if (!options_.joins) {
        auto driving = options_.setup.driving;
        driving.start.x += driving.start.v * now();
        vehicle_.begin(driving, now());
    }
    const auto ended = [this](const std::exception_ptr& failure) {
        failure_ = failure;
        end();
    };
    if (options_.joins) {
        asio::co_spawn(io_, join(), [this, ended](const std::exception_ptr& failure) {
            if (failure) {
                ended(failure);
            } else {
                asio::co_spawn(io_, drive(), ended);
            }
        });
    } else {
        asio::co_spawn(io_, drive(), ended);
    }
    io_.run();
    if (failure_) {
        std::rethrow_exception(failure_);
    }
    return vehicle_.report();
}

asio::awaitable<known_vehicles> vehicle_node::listen() {
    known_vehicles heard;
    auto feed = co_await service_.async_bind<state_message>("all:state");
    asio::steady_timer enough{io_,
                              300ms + std::chrono::milliseconds{static_cast<int>(3000 / options_.setup.driving.hz)}};
    enough.async_wait([&feed](boost::system::error_code failed) {
        if (!failed) {
            feed.close();
        }
    });
    try {
        for (;;) {
            const auto item = co_await next_state(feed);
            if (item.has_value()) {
                const auto told = to_state(item.value, options_.setup.start_utc);
                if (implausible(told, options_.setup.driving.law).empty()) {
                    heard[item.publisher] = told;
                }
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
    const bool merges = !options_.behind.empty();
    const join_request self{vehicle_.name(), merges};
    for (const double until = now() + join_timeout;;) {
        const auto heard = co_await listen();
        if (heard.empty()) {
            throw cles::error(cles::errc::no_target, "there is no platoon: no vehicle was found in the group " +
                                                         options_.group.group + ":" +
                                                         std::to_string(options_.group.port));
        }
        if (heard.contains(self.name)) {
            throw cles::error(cles::errc::invalid_name, "a vehicle named " + self.name + " is already on the road");
        }
        if (merges && !heard.contains(options_.behind)) {
            throw cles::error(cles::errc::no_target, options_.behind + " is not received");
        }
        const auto last = merges ? options_.behind : last_vehicle(heard);
        std::optional<cles::error> refused;
        try {
            if (heard.at(last).tells_lead) { // others cannot be asked
                co_await service_.async_push(last + ":join", self);
            }
        } catch (const cles::error& e) {
            refused = e;
        }
        if (!refused) {
            vehicle_.begin(setup_behind(last, merges, heard, options_.setup.driving, now()), now());
            co_return;
        }
        if (now() >= until) {
            throw cles::error(refused->code(), refused->message());
        }
    }
}

asio::awaitable<void> vehicle_node::drive() {
    asio::steady_timer timer{io_};
    while (!vehicle_.has_left(now())) {
        const double at = vehicle_.next();
        timer.expires_at(steady::time_point{std::chrono::nanoseconds{options_.start_ns + std::llround(at * 1e9)}});
        co_await timer.async_wait(asio::use_awaitable);
        if (auto told = vehicle_.decide()) {
            publish(std::move(*told));
        }
        if (options_.seconds > 0 && at >= options_.seconds) {
            break;
        }
    }
}

void vehicle_node::publish(state_message told) {
    told.sent_ns = monotonic_ns();
    service_.update("state", told);
    service_.update("localization", localization_of(told));
    for (const auto& name : vehicle_.bound_to()) {
        keep(bound_, name, &vehicle_node::hear);
    }
    for (const auto& name : vehicle_.clocks_to_ask(now())) {
        asio::co_spawn(io_, ask_clock(name), asio::detached);
    }
    if (!options_.exchange.empty() && !vehicle_.seen().empty()) {
        keep(watched_, vehicle_.seen(), &vehicle_node::watch);
    }
}

void vehicle_node::keep(std::set<std::string>& open, const std::string& name,
                        asio::awaitable<void> (vehicle_node::*feed)(std::string)) {
    if (!open.insert(name).second) {
        return;
    }
    asio::co_spawn(io_, (this->*feed)(name), [this, &open, name](const std::exception_ptr& failure) {
        open.erase(name); // the next update retries it, if it is still needed
        const auto why = failure ? name + " cannot be received: " + reason_of(failure) : "";
        if (failure && now() >= 0 && reported_.insert(why).second) { // before, it may not have started yet
            vehicle_.note(now(), "unheard", why);
        }
    });
}

asio::awaitable<void> vehicle_node::hear(std::string name) {
    auto feed = co_await service_.async_bind<state_message>(name + ":state", cles::bind_options{}.multicast());
    bool first = true; // may be an older one, repeated for this binder
    while (vehicle_.is_bound_to(name)) {
        const auto item = co_await next_state(feed);
        if (item.has_value()) {
            if (vehicle_.receive(name, item.value, now(), first) && item.value.sent_ns) {
                vehicle_.note_latency(static_cast<double>(monotonic_ns() - *item.value.sent_ns) * 1e-3);
            }
            first = false;
        } else if (item.kind == cles::feed_event::gap) {
            vehicle_.note_gap(item.missed, now());
            if (!item.text.empty() && reported_.insert(name).second) {
                vehicle_.note(now(), "dropped", "an update of " + name + ": " + item.text);
            }
        }
    }
}

asio::awaitable<void> vehicle_node::watch(std::string name) {
    auto feed = co_await service_.async_bind<state_message>(
        name + ":state", cles::bind_options{}.at(exchange_url(options_.exchange, name), name));
    while (vehicle_.seen() == name) {
        const auto item = co_await next_state(feed);
        if (item.has_value()) {
            vehicle_.see(name, item.value);
        }
    }
}

// One that has no such task, or is not known yet, is asked again later.
asio::awaitable<void> vehicle_node::ask_clock(std::string name) {
    const double sent = now();
    try {
        const auto told =
            co_await service_.async_pull<clock_reading>(name + ":clock", cles::call_options{}.deadline(clock_deadline));
        vehicle_.note_clock(name, sent, told.utc, now());
    } catch (const cles::error& e) {
        if (e.code() == cles::errc::no_task) {
            vehicle_.note_no_clock(name, now());
        }
    }
}

} // namespace platoon
