// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/vehicle.hpp"

#include "platoon/driver/pace.hpp"

#include <boost/describe/enum_to_string.hpp>

#include <cmath>
#include <utility>

namespace platoon {
namespace {

constexpr double join_interval = 5;              // s in which only one vehicle may join
constexpr std::size_t max_latencies = 1'000'000; // stored of one drive
constexpr double process_delay = 0.2;            // s, by which an update may be late if its sender is still there
constexpr std::size_t first_exchanges = 4;       // with the clock of another vehicle, ...
constexpr double first_interval = 0.2;           // ... which follow each other in this time, s; the others in this one:
constexpr double exchange_interval = 2;
constexpr double no_clock_interval = 10; // s, after which one that had no such task is asked again
constexpr double leave_duration = 1;     // s in which it announces that it leaves

} // namespace

std::uint64_t seed_for(const std::string& purpose, std::uint64_t seed) {
    for (const char c : purpose) {
        seed = seed * 1'000'003 + static_cast<unsigned char>(c);
    }
    return seed;
}

vehicle::vehicle(vehicle_setup setup)
    : setup_(std::move(setup)), decisions_(decisions_per_update(setup_.driving.hz)),
      echoes_(decisions_per_echo(setup_.driving.radar, setup_.driving.hz)),
      first_(send_offset(setup_.turn, setup_.turns, setup_.driving.hz)),
      pace_(1 / (setup_.driving.hz * static_cast<double>(decisions_))),
      sensor_(setup_.driving.radar, seed_for("radar", setup_.seed)) {
    report_.vehicle = setup_.driving.name;
}

void vehicle::begin(const driver_setup& driving, double now) {
    driver_.emplace(driving, now);
    driver_->on_change = [this](double at, role mode, const std::string& why) {
        note(at, boost::describe::enum_to_string(mode, ""), why);
    };
    driver_->on_drop = [this](double at, const std::string& from, const std::string& why) {
        note(at, "dropped", "an update of " + from + ", because its " + why);
    };
    count_ = static_cast<std::int64_t>(std::ceil((now - first_) / pace_));
}

double vehicle::next() const noexcept { return first_ + pace_ * static_cast<double>(count_); }

std::optional<state_message> vehicle::decide() {
    const double at = next();
    const auto count = count_++;
    if (count % echoes_ == 0) {
        measure(at);
    }
    driver_->step(at);
    if (count % decisions_ != 0) {
        return std::nullopt;
    }
    ++report_.sent;
    return reduced(to_message(driver_->report(), setup_.start_utc), setup_.tells);
}

void vehicle::measure(double at) {
    if (!driver_->ahead().empty()) {
        seen_ = driver_->ahead();
    }
    const auto found = truth_.find(seen_);
    if (found == truth_.end() || driver_->mode() == role::merge || found->second.mode == role::merge) {
        return;
    }
    const auto& ahead = found->second;
    const double age = at - ahead.t;
    const bool ended = age > driver::silent_after / setup_.driving.hz + process_delay;
    if (ended && ahead.mode == role::leave) {
        seen_.clear();
        return;
    }
    // As the observer of the drive assumes it.
    const auto there = ended ? without_driver(ahead, at) : advance(ahead.position(), ahead.u, ahead.lag, age);
    const auto self = advance(driver_->position(), driver_->command(), driver_->limits().lag, at - driver_->now());
    const echo exact{.range = there.x - ahead.length - self.x, .rate = there.v - self.v};
    if (const auto seen = sensor_.measure(exact)) {
        driver_->measure(*seen, at);
    }
}

std::set<std::string> vehicle::bound_to() const {
    auto names = driver_ ? driver_->needed() : std::set<std::string>{};
    if (!setup_.separate_truth && !seen_.empty()) {
        names.insert(seen_);
    }
    return names;
}

bool vehicle::is_bound_to(const std::string& name) const {
    return (driver_ && driver_->needs(name)) || (!setup_.separate_truth && name == seen_);
}

bool vehicle::receive(const std::string& from, const state_message& told, double now, bool repeated) {
    const auto heard = to_state(told, setup_.start_utc);
    const bool counts = !repeated && heard.t >= 0; // updates are exchanged before the drive starts, too
    report_.received += counts ? 1 : 0;
    if (!setup_.separate_truth) {
        see(from, told);
    }
    if (driver_) {
        driver_->receive(from, heard, now);
    }
    return counts;
}

void vehicle::note_gap(std::uint64_t missed, double now) { report_.missed += now >= 0 ? missed : 0; }

std::set<std::string> vehicle::clocks_to_ask(double now) {
    std::set<std::string> names;
    if (!driver_) {
        return names;
    }
    const auto needed = driver_->needed();
    std::erase_if(clocks_, [&needed](const auto& each) { return !needed.contains(each.first); });
    for (const auto& name : needed) {
        auto& one = clocks_[name];
        if (now >= one.ask_at) {
            one.ask_at = now + (one.difference.exchanges() < first_exchanges ? first_interval : exchange_interval);
            names.insert(name);
        }
    }
    return names;
}

void vehicle::note_no_clock(const std::string& of, double now) { clocks_[of].ask_at = now + no_clock_interval; }

void vehicle::note_clock(const std::string& of, double sent, double utc, double received) {
    if (!std::isfinite(utc)) {
        return; // `null` is read as NaN, which would remain among the last exchanges
    }
    auto& one = clocks_[of].difference;
    one.add(sent, utc - setup_.start_utc, received);
    if (driver_) {
        driver_->synchronise(of, *one.value());
    }
}

void vehicle::see(const std::string& which, const state_message& told) {
    auto heard = to_state(told, setup_.start_utc);
    if (implausible(heard, setup_.driving.law).empty()) {
        truth_[which] = std::move(heard);
    }
}

void vehicle::note_latency(double microseconds) {
    if (report_.latency_us.size() < max_latencies) {
        report_.latency_us.push_back(microseconds);
    }
}

std::string vehicle::accept_follower(const join_request& who, double now) {
    if (!driver_ || left_at_) {
        return name() + " is about to leave, or has not started yet";
    }
    if (!follower_.empty() && follower_ != who.name && now < followed_at_ + join_interval) {
        return follower_ + " is joining behind " + name();
    }
    if (who.merges && !driver_->admits().empty() && driver_->admits() != who.name) {
        return driver_->admits() + " is merging behind " + name();
    }
    follower_ = who.name;
    followed_at_ = now;
    if (who.merges) {
        driver_->admit(who.name);
    }
    return "";
}

std::string vehicle::split() {
    if (!setup_.driving.radar.fitted) {
        return name() + " has no radar to keep a distance by";
    }
    if (driver_ && !driver_->ahead().empty()) {
        driver_->split();
    }
    return "";
}

void vehicle::leave(double now) {
    if (driver_ && !left_at_) {
        driver_->leave();
        left_at_ = now + leave_duration;
    }
}

void vehicle::note(double at, const std::string& mode, const std::string& why) {
    report_.events.push_back({at, name(), mode, why});
    if (on_note) {
        on_note(report_.events.back());
    }
}

} // namespace platoon
