// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/vehicle_node.hpp"

#include "client/member_key.hpp"
#include "output/log_line.hpp"
#include "platoon/simulation/simulation.hpp"

#include <boost/asio/co_spawn.hpp>
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

constexpr double approach_distance = 40; // m behind the last vehicle at the start
constexpr double join_interval = 5;      // s in which only one vehicle may join
constexpr double join_timeout = 2 * join_interval;
constexpr std::size_t max_latencies = 1'000'000; // stored of one drive
constexpr double process_delay = 0.2;            // s, by which an update may be late if its sender is still there
constexpr double leave_duration = 1;             // s in which it announces that it leaves

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
    out.name = vehicle.setup.name;
    out.listen = listen_urls(vehicle.group, secured ? "tls" : "tcp");
    out.insecure = vehicle.insecure;
    out.multicast = vehicle.group;
    return out;
}

// Each link and the radar have random numbers of their own.
std::uint64_t seed_for(const std::string& purpose, std::uint64_t seed) {
    for (const char c : purpose) {
        seed = seed * 1'000'003 + static_cast<unsigned char>(c);
    }
    return seed;
}

/// The vehicle that follows this one; empty: none.
std::string follower_of(const std::string& ahead, const std::map<std::string, state>& heard) {
    const auto found =
        std::find_if(heard.begin(), heard.end(), [&ahead](const auto& each) { return each.second.ahead == ahead; });
    return found == heard.end() ? "" : found->first;
}

/// The last vehicle of a platoon: the one that no other follows; of several, the rearmost.
std::string last_vehicle(const std::map<std::string, state>& heard) {
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

std::int64_t monotonic_ns() { return std::chrono::nanoseconds{steady::now().time_since_epoch()}.count(); }

double utc_at(std::int64_t monotonic) {
    const std::chrono::duration<double> utc = std::chrono::system_clock::now().time_since_epoch();
    return utc.count() + static_cast<double>(monotonic - monotonic_ns()) * 1e-9;
}

vehicle_node::vehicle_node(vehicle_options options)
    : options_(std::move(options)), service_(io_, options_of(options_)), signals_(io_, SIGTERM, SIGINT),
      sensor_(options_.setup.radar, seed_for("radar", options_.seed)),
      log_(tool::stream::err, [](std::uint64_t count) { return tool::dropped_text(count) + "\n"; }) {
    report_.vehicle = options_.setup.name;
    service_.on_bind("state", {.description = "Its mode, position, speed and acceleration",
                               .must_be_signed = !options_.keys.empty()});
    service_.on_push("join", [this](const join_request& who) { accept_follower(who); },
                     {.description = "Follow this vehicle, the last one", .parameters = {}});
    service_.on_push("split",
                     [this] {
                         if (!options_.setup.radar.fitted) {
                             throw cles::error(cles::errc::unavailable, report_.vehicle + " has no radar to keep a "
                                                                                          "distance by");
                         }
                         if (driver_ && !driver_->ahead().empty()) {
                             driver_->split();
                         }
                     },
                     {.description = "Lead those behind, at a distance", .parameters = {}, .idempotent = true});
    service_.on_push("leave",
                     [this] {
                         if (driver_ && !left_at_) {
                             driver_->leave();
                             left_at_ = now() + leave_duration;
                         }
                     },
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
        auto setup = options_.setup;
        setup.start.x += setup.start.v * now();
        begin(setup);
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
    return std::move(report_);
}

void vehicle_node::begin(const driver_setup& setup) {
    driver_.emplace(setup, now());
    driver_->on_change = [this](double at, role mode, const std::string& why) {
        note(at, boost::describe::enum_to_string(mode, ""), why);
    };
    driver_->on_drop = [this](double at, const std::string& from, const std::string& why) {
        note(at, "dropped", "an update of " + from + ", because its " + why);
    };
}

void vehicle_node::note(double at, const std::string& mode, const std::string& why) {
    std::array<char, 32> time{};
    std::snprintf(time.data(), time.size(), "%8.3f s  ", at);
    log_.write(time.data() + report_.vehicle + "  " + mode + ": " + why + "\n");
    report_.events.push_back({at, report_.vehicle, mode, why});
}

void vehicle_node::accept_follower(const join_request& who) {
    if (!driver_ || left_at_) {
        throw cles::error(cles::errc::busy, report_.vehicle + " is about to leave, or has not started yet");
    }
    if (!follower_.empty() && follower_ != who.name && now() < followed_at_ + join_interval) {
        throw cles::error(cles::errc::busy, follower_ + " is joining behind " + report_.vehicle);
    }
    if (who.merges && !driver_->admits().empty() && driver_->admits() != who.name) {
        throw cles::error(cles::errc::busy, driver_->admits() + " is merging behind " + report_.vehicle);
    }
    follower_ = who.name;
    followed_at_ = now();
    if (who.merges) {
        driver_->admit(who.name);
    }
}

asio::awaitable<std::map<std::string, state>> vehicle_node::listen() {
    std::map<std::string, state> heard;
    auto feed = co_await service_.async_bind<localization>("all:state");
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
                const auto told = to_state(item.value, options_.start_utc);
                if (implausible(told, options_.setup.law).empty()) {
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
    const join_request self{options_.setup.name, merges};
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
            co_await service_.async_push(last + ":join", self);
        } catch (const cles::error& e) {
            refused = e;
        }
        if (!refused) {
            auto setup = options_.setup;
            const auto& at = heard.at(last);
            setup.ahead = last;
            setup.merges = merges;
            setup.before = merges ? follower_of(last, heard) : "";
            const double since = now() - at.t;
            const double distance = merges ? setup.spacing : approach_distance;
            setup.start = {at.x + at.v * since - distance, at.v, 0};
            begin(setup);
            co_return;
        }
        if (now() >= until) {
            throw cles::error(refused->code(), refused->message());
        }
    }
}

asio::awaitable<void> vehicle_node::drive() {
    const double hz = options_.setup.hz;
    const auto decisions = std::int64_t{decisions_per_update(hz)};
    const auto echoes = std::int64_t{decisions_per_echo(options_.setup.radar, hz)};
    const double pace = 1 / (hz * static_cast<double>(decisions));
    const double first = send_offset(options_.turn, options_.turns, hz);
    asio::steady_timer timer{io_};
    for (auto count = static_cast<std::int64_t>(std::ceil((now() - first) / pace)); !left_at_ || now() < *left_at_;
         ++count) {
        const double at = first + pace * static_cast<double>(count);
        const std::chrono::nanoseconds due{options_.start_ns + std::llround(at * 1e9)};
        timer.expires_at(steady::time_point{due});
        co_await timer.async_wait(asio::use_awaitable);
        if (count % echoes == 0) {
            measure(at);
        }
        driver_->step(at);
        if (count % decisions == 0) {
            publish_state();
        }
        if (options_.seconds > 0 && at >= options_.seconds) {
            break;
        }
    }
}

impairment& vehicle_node::link_from(const std::string& name) {
    return links_.try_emplace(name, options_.losses, options_.delay, seed_for(name, options_.seed)).first->second;
}

void vehicle_node::measure(double at) {
    if (!driver_->ahead().empty()) {
        seen_ = driver_->ahead();
    }
    const auto found = truth_.find(seen_);
    if (found == truth_.end() || driver_->mode() == role::merge || found->second.mode == role::merge) {
        return;
    }
    const auto& ahead = found->second;
    const double age = at - ahead.t;
    const bool ended = age > driver::silent_after / options_.setup.hz + process_delay;
    if (ended && ahead.mode == role::leave) {
        seen_.clear();
        return;
    }
    // As the observer of the drive assumes it.
    const auto there = ended ? without_driver(ahead, at) : advance(ahead.position(), ahead.u, ahead.lag, age);
    const auto self = advance(driver_->position(), driver_->command(), driver_->limits().lag, at - driver_->now());
    const echo exact{.range = there.x - driver_->limits().length - self.x, .rate = there.v - self.v};
    if (const auto seen = sensor_.measure(exact)) {
        driver_->measure(*seen, at);
    }
}

void vehicle_node::publish_state() {
    auto told = to_localization(driver_->report(), options_.start_utc);
    told.sent_ns = monotonic_ns();
    service_.update("state", told);
    ++report_.sent;
    auto needed = driver_->needed();
    if (!seen_.empty()) {
        needed.insert(seen_);
    }
    for (const auto& name : needed) {
        if (bound_.insert(name).second) {
            asio::co_spawn(io_, hear(name), [this, name](const std::exception_ptr& failure) {
                bound_.erase(name); // the next update retries it, if it is still needed
                const auto why = failure ? name + " cannot be received: " + reason_of(failure) : "";
                if (failure && reported_.insert(why).second) {
                    note(now(), "unheard", why);
                }
            });
        }
    }
}

asio::awaitable<void> vehicle_node::hear(std::string name) {
    auto feed = co_await service_.async_bind<localization>(name + ":state", cles::bind_options{}.multicast());
    bool first = true; // may be an older one, repeated for this binder
    while (driver_->needs(name) || name == seen_) {
        const auto item = co_await feed.async_next();
        if (item.has_value()) {
            receive(name, to_state(item.value, options_.start_utc), !first);
            first = false;
        } else if (item.kind == cles::feed_event::gap) {
            report_.missed += item.missed;
        }
    }
}

void vehicle_node::receive(const std::string& from, const state& heard, bool timely) {
    const bool counts = timely && heard.t >= 0; // only during the drive: updates are exchanged before it starts too
    if (counts) {
        ++report_.received;
        if (report_.latency_us.size() < max_latencies) {
            report_.latency_us.push_back(static_cast<double>(monotonic_ns() - heard.sent_ns) * 1e-3);
        }
    }
    if (implausible(heard, options_.setup.law).empty()) {
        truth_[from] = heard;
    }
    const auto later = link_from(from).next();
    if (!later) {
        report_.lost += counts ? 1 : 0;
    } else if (*later == 0) {
        driver_->receive(from, heard, now());
    } else {
        auto timer = std::make_shared<asio::steady_timer>(
            io_, std::chrono::duration_cast<steady::duration>(std::chrono::duration<double>{*later}));
        timer->async_wait([this, timer, from, heard](boost::system::error_code failed) {
            if (!failed) {
                driver_->receive(from, heard, now());
            }
        });
    }
}

} // namespace platoon
