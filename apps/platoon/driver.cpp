// SPDX-License-Identifier: BSL-1.0
#include "driver.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

constexpr double trend_time = 0.05;      // s, over which the change of the command is smoothed
constexpr double start_timeout = 1;      // s, at the start, for the first update
constexpr double lead_after = 0.5;       // s of fallback, after which this vehicle leads those behind
constexpr double fallback_brake = 4;     // m/s², more than a vehicle without a driver
constexpr double fallback_growth = 15;   // m/s² after 1 s, growing with the square: a late update changes little
constexpr double fallback_jerk = 5;      // m/s³, if no update was ever received
constexpr double fade_time = 0.5;        // s in which the weight of the leader fades out and in
constexpr double close_up_speed = 1.5;   // m/s
constexpr double distance_tolerance = 2; // m

} // namespace

driver::driver(driver_setup setup, double now)
    : setup_(std::move(setup)), self_(setup_.start), now_(now), began_(std::max(now, 0.0)), ahead_(setup_.ahead),
      distance_(setup_.spacing) {
    if (ahead_.empty()) {
        mode_ = role::lead;
        lead_ = setup_.name;
    }
}

std::set<std::string> driver::needed() const {
    std::set<std::string> names{ahead_, next_, lead_};
    std::erase_if(names, [this](const auto& name) { return !needs(name); });
    return names;
}

bool driver::needs(const std::string& name) const {
    return name != setup_.name && !name.empty() && (name == ahead_ || name == lead_ || name == next_);
}

const track* driver::heard(const std::string& name) const {
    const auto found = tracks_.find(name);
    return found != tracks_.end() && found->second.known() ? &found->second : nullptr;
}

bool driver::silent(const std::string& name) const {
    const auto* who = heard(name);
    return who == nullptr ? now_ - began_ > start_timeout : who->silence(now_) > silent_after / setup_.hz;
}

void driver::enter(role mode, const std::string& why) {
    if (mode_ != mode) {
        mode_ = mode;
        if (on_change) {
            on_change(now_, mode, why);
        }
    }
}

void driver::leave() { leaving_ = true; }

void driver::receive(const std::string& from, const state& heard_now, double now) {
    if (!needs(from)) {
        return;
    }
    bool anew = !tracks_.contains(from) || lead_ == setup_.name;
    auto& who = tracks_.try_emplace(from, setup_.limits.lag).first->second;
    who.receive(heard_now, now);
    if (from == next_) {
        ahead_ = next_;
        next_.clear();
        anew = true;
    }
    if (from != ahead_) {
        return;
    }
    if (anew) {
        const double measured = who.at(now).x - advance(self_, command_, setup_.limits.lag, now - now_).x;
        distance_ = std::abs(measured - setup_.spacing) < distance_tolerance ? setup_.spacing : measured;
    }
    choose_leader(who.last());
    if (who.last().mode == role::leave) {
        take_over(who.last());
    }
}

void driver::take_over(const state& from) {
    next_ = from.ahead;
    if (next_.empty()) { // the leader leaves, and this vehicle takes its place
        ahead_.clear();
        lead_ = setup_.name;
        behind_ = 0;
        setup_.plan = {.speed = self_.v, .slow = self_.v};
        enter(role::lead, "the leader leaves");
    }
}

void driver::choose_leader(const state& of_ahead) {
    if (lead_ != of_ahead.lead) {
        lead_ = of_ahead.lead;
        weight_ = mode_ == role::follow && now_ - began_ < start_timeout ? 1 : 0;
    }
    behind_ = distance_ + of_ahead.behind;
}

void driver::step(double now) {
    const double dt = now - now_;
    self_ = advance(self_, command_, setup_.limits.lag, dt);
    now_ = now;
    const double before = command_;
    if (mode_ == role::lead) {
        command_ = setup_.plan.command(now);
    } else if (silent(ahead_)) {
        fall_back(dt);
    } else if (heard(ahead_) != nullptr) {
        follow(dt);
    }
    command_ = std::clamp(command_, -setup_.limits.brake, setup_.limits.accelerate);
    if (dt > 0) {
        trend_ += ((command_ - before) / dt - trend_) * std::min(1.0, dt / trend_time);
    }
}

void driver::follow(double dt) {
    close_up(dt);
    const auto mode_ahead = heard(ahead_)->last().mode;
    const bool broken = mode_ahead == role::fallback && lead_ != ahead_;
    const bool leader_silent = lead_ != ahead_ && silent(lead_);
    if (lead_.empty() && leader_silent) {
        enter(role::degraded, ahead_ + " ahead does not report the leader");
    } else if (leader_silent || broken) {
        enter(role::degraded, leader_silent ? "the leader " + lead_ + " is silent" : ahead_ + " ahead has fallen back");
    } else {
        enter(role::follow, "receives " + ahead_ + " and " + lead_);
    }
    const bool counts = setup_.uses_leader && mode_ == role::follow && heard(lead_) != nullptr;
    doubt_ = counts ? 0 : doubt_ + dt;
    const double left = 1 - std::pow(doubt_ / fade_time, 3); // so that a short interruption changes almost nothing
    weight_ = counts ? std::min(1.0, weight_ + dt / fade_time) : std::clamp(left, 0.0, weight_);
    command_ = law(setup_.uses_leader ? weight_ : 0);
}

double driver::law(double weight) const {
    const auto reference_to = [this](const std::string& name, double distance) {
        const auto* who = heard(name);
        if (who == nullptr) {
            return reference{};
        }
        return reference{who->at(now_), who->command_at(now_), distance};
    };
    return spacing_law(setup_.law, self_, reference_to(ahead_, distance_), reference_to(lead_, behind_),
                       heard(lead_) == nullptr ? 0 : weight);
}

void driver::close_up(double dt) {
    const double before = distance_;
    distance_ = std::max(setup_.spacing, distance_ - close_up_speed * dt);
    behind_ += distance_ - before;
}

void driver::fall_back(double dt) {
    if (mode_ != role::fallback) {
        fallback_since_ = now_;
        enter(role::fallback,
              heard(ahead_) == nullptr ? ahead_ + " ahead was never received" : ahead_ + " ahead is silent");
    }
    const double since = now_ - fallback_since_;
    if (heard(ahead_) != nullptr && since <= lead_after) { // the normal command, reduced more and more
        const double as_before = law(weight_);
        command_ = std::max(as_before - fallback_growth * since * since, std::min(as_before, -fallback_brake));
    } else {
        // If it already brakes harder, it continues, because the one ahead may too.
        command_ = std::min(command_, std::max(command_ - fallback_jerk * dt, -fallback_brake));
    }
    if (since > lead_after && lead_ != setup_.name) {
        lead_ = setup_.name;
        behind_ = 0;
        weight_ = 0;
    }
}

state driver::report() const {
    return {.mode = leaving_ ? role::leave : mode_,
            .ahead = ahead_,
            .lead = lead_,
            .behind = behind_,
            .t = now_,
            .x = self_.x,
            .v = self_.v,
            .a = self_.a,
            .u = command_,
            .j = trend_};
}

} // namespace platoon
