// SPDX-License-Identifier: BSL-1.0
#include "platoon/driver/driver.hpp"

#include "platoon/driver/emergency.hpp"

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
constexpr double fade_time = 1;          // s in which the weight of the leader fades out and in
constexpr double close_up_speed = 1.5;   // m/s
constexpr double distance_tolerance = 2; // m
constexpr double cruise_gain = 0.5;      // 1/s
constexpr double cruise_limit = 1;       // m/s²

// While updates of the one ahead are missing, and others tell what it does.
// More than one period, because an update may be late, but so that after two there is an answer before the third.
constexpr double missed_after = 1.75;  // periods
constexpr double refuting_error = 0.3; // m, from what the radar sees
constexpr double refuting_speed = 0.5; // m/s

// With the radar alone.
constexpr double slower_by = 0.5;        // m/s, than updates say: from there on, the radar is right
constexpr double radar_share_time = 0.8; // s, in which its estimate replaces the extrapolated update
constexpr double full_time_gap = 1.5;    // s
constexpr double standstill_gap = 5;     // m
constexpr double open_speed = 2;         // m/s, at which the gap opens
constexpr double least_time_gap = 0.5;   // s, in the gain: a smaller one would react to noise, faster than the vehicle
constexpr double radar_gain = 0.4;       // 1/s
constexpr double switch_time = 1;        // s, from the law for constant spacing to the one for a time gap
constexpr double trust_after = 2; // s without a gap in the updates, after which the distance becomes smaller again

// Behind a vehicle that does not tell its leader.
constexpr double lone_time_gap = 1;   // s
constexpr double averaging_time = 20; // s, of the distance of the one ahead to its leader

// A merge.
constexpr double merge_timeout = 60;  // s, for the vehicle that joins
constexpr double in_lane_notice = 2;  // s, for which it is still named when it is in the lane
constexpr double merge_tolerance = 2; // m, of the distances ahead and behind
constexpr double merge_speed = 1.5;   // m/s, of the difference to the one ahead

reference blend(const reference& from, const reference& to, double share) {
    const auto between = [share](double a, double b) { return a + share * (b - a); };
    return {.where = {.x = between(from.where.x, to.where.x),
                      .v = between(from.where.v, to.where.v),
                      .a = between(from.where.a, to.where.a)},
            .command = between(from.command, to.command),
            .distance = to.distance};
}

} // namespace

driver::driver(driver_setup setup, double now)
    : setup_(std::move(setup)), self_(setup_.start), now_(now), began_(std::max(now, 0.0)), ahead_(setup_.ahead),
      distance_(setup_.spacing), link_(began_), radar_(setup_.radar) {
    if (ahead_.empty()) {
        mode_ = role::lead;
        lead_ = setup_.name;
    } else if (setup_.merges) {
        mode_ = role::merge;
    }
}

std::set<std::string> driver::needed() const {
    std::set<std::string> names{ahead_, next_, lead_, beyond_, admits_, makes_room_for_, setup_.before};
    std::erase_if(names, [this](const auto& name) { return !needs(name); });
    return names;
}

bool driver::needs(const std::string& name) const {
    return !name.empty() &&
           (name == ahead_ || name == lead_ || name == next_ || name == beyond_ || name == admits_ ||
            name == makes_room_for_ || (mode_ == role::merge && name == setup_.before)) &&
           name != setup_.name;
}

const track* driver::heard(const std::string& name) const {
    const auto found = tracks_.find(name);
    return found != tracks_.end() && found->second.known() ? &found->second : nullptr;
}

bool driver::silent(const std::string& name) const {
    const auto* who = heard(name);
    return who == nullptr ? now_ - began_ > start_timeout : who->silence(now_) > silent_after / setup_.hz;
}

bool driver::misses(const std::string& name) const {
    const auto* who = heard(name);
    return who == nullptr || who->silence(now_) > missed_after / setup_.hz;
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

void driver::admit(const std::string& name) {
    admits_ = name;
    admits_until_ = now_ + merge_timeout;
}

void driver::split() {
    ahead_.clear();
    next_.clear();
    beyond_.clear();
    makes_room_for_.clear();
    cruise_ = self_.v;
    lead_those_behind();
    enter(role::lead, "it splits off");
}

void driver::measure(const echo& seen, double now) {
    const double distance = seen.range + length_ahead();
    if (heard(ahead_) == nullptr && mode_ == role::follow && std::abs(distance - distance_) > distance_tolerance) {
        distance_ = std::max(distance, setup_.spacing); // it does not know yet which one is desired
    }
    radar_.measure(seen, advance(self_, applied_, setup_.limits.lag, now - now_), now);
}

void driver::receive(const std::string& from, const state& heard_now, double now) {
    if (!needs(from) || drops(from, heard_now, now)) {
        return;
    }
    bool anew = heard(from) == nullptr || (lead_ == setup_.name && !opens_since_);
    auto& who = tracks_[from];
    const bool is_newer = who.receive(heard_now, now);
    const bool in_lane = who.last().mode != role::merge;
    if (from == admits_ && in_lane && who.last().ahead == setup_.name) {
        admits_until_ = std::min(admits_until_, now + in_lane_notice);
    }
    if (from == next_ || (from == makes_room_for_ && in_lane && who.last().ahead == ahead_)) {
        ahead_ = from;
        next_.clear();
        makes_room_for_.clear();
        link_ = link_quality{now};
        anew = true;
    }
    if (from != ahead_) {
        return;
    }
    if (is_newer) { // others, such as those that somebody repeats, say nothing about the link now
        link_.receive(now);
    }
    if (anew) {
        measure_distance(who, now);
    }
    refuted_ = false;
    beyond_ = who.last().lead == ahead_ ? "" : who.last().ahead;
    makes_room_for_ = mode_ == role::merge || who.last().admits == setup_.name ? "" : who.last().admits;
    if (!opens_since_ && !knows_no_leader()) { // else it leads, until it rejoins
        choose_leader(who.last());
    }
    const auto* beyond = heard(beyond_);
    to_beyond_ = beyond == nullptr ? std::nullopt : std::optional{who.last().behind - beyond->last().behind};
    if (who.last().mode == role::leave) {
        take_over(who.last());
    }
}

void driver::synchronise(const std::string& with, double difference) { tracks_[with].set_difference(difference); }

void driver::measure_distance(const track& ahead, double now) {
    const double measured = ahead.at(now).x - advance(self_, applied_, setup_.limits.lag, now - now_).x;
    distance_ = std::abs(measured - wanted()) < distance_tolerance ? wanted() : measured;
}

bool driver::drops(const std::string& from, const state& told, double now) {
    const auto why = implausible(told, setup_.law);
    if (!why.empty() && dropped_.insert(from + ": " + why).second && on_drop) {
        on_drop(now, from, why);
    }
    return !why.empty();
}

void driver::take_over(const state& from) {
    next_ = from.ahead;
    if (next_.empty()) { // the leader leaves, and this vehicle takes its place
        ahead_.clear();
        beyond_.clear();
        lead_ = setup_.name;
        behind_ = 0;
        cruise_ = self_.v;
        enter(role::lead, "the leader leaves");
    }
}

void driver::choose_leader(const state& of_ahead) {
    const auto& leader = of_ahead.tells_lead ? of_ahead.lead : setup_.leader;
    if (lead_ != leader) {
        lead_ = leader;
        weight_ = mode_ == role::follow && now_ - began_ < start_timeout ? 1 : 0;
    }
    behind_ = distance_ + ahead_behind_leader(of_ahead);
}

// On average, because its errors are not the distance that it wants to keep.
double driver::ahead_behind_leader(const state& of_ahead) {
    if (of_ahead.tells_lead) {
        return of_ahead.behind;
    }
    const auto* leader = heard(lead_);
    if (leader == nullptr || lead_ == ahead_) {
        return 0;
    }
    const double measured = leader->at(now_).x - heard(ahead_)->at(now_).x;
    apart_ = apart_.value_or(measured) + (measured - apart_.value_or(measured)) / (setup_.hz * averaging_time);
    return *apart_;
}

void driver::step(double now) {
    const double dt = now - now_;
    self_ = advance(self_, applied_, setup_.limits.lag, dt);
    now_ = now;
    const double before = command_;
    if (!admits_.empty() && now_ > admits_until_) {
        admits_.clear();
    }
    link_.step(now_);
    infer_ahead();
    from_leader_.reset();
    if (mode_ == role::lead) {
        lead(dt);
    } else if (!silent(ahead_) && !keeps_off()) {
        if (heard(ahead_) != nullptr && knows_no_leader()) {
            follow_alone(dt);
        } else if (heard(ahead_) != nullptr) {
            follow(dt);
        }
    } else if (mode_ == role::merge) { // in a lane of its own
        command_ = 0;
    } else if (radar_.sees(now_)) {
        follow_by_radar(dt);
    } else {
        fall_back(dt);
    }
    brake_in_emergency();
    command_ = std::clamp(command_, -setup_.limits.brake, setup_.limits.accelerate);
    applied_ =
        std::clamp(compensated(command_, self_.a, setup_.limits.lag), -setup_.limits.brake, setup_.limits.accelerate);
    if (dt > 0) {
        trend_ += ((command_ - before) / dt - trend_) * std::min(1.0, dt / trend_time);
    }
}

// Although updates arrive.
bool driver::keeps_off() const {
    return mode_ != role::merge && link_.is_poor() && heard(ahead_) != nullptr && radar_.sees(now_);
}

// If it sees the one ahead slower than its updates say, or what was derived from them, then those are wrong.
void driver::heed_radar(const reference& ahead) {
    if (mode_ == role::merge || !radar_.sees(now_)) {
        return;
    }
    auto seen = radar_.at(now_);
    if (seen.v < ahead.where.v - slower_by) {
        seen.x += length_ahead();
        const reference truth{.where = seen, .command = seen.a, .distance = distance_};
        command_ = std::min(command_, spacing_law(setup_.law, self_, truth, 0, 0));
    }
}

// Whatever updates say.
void driver::brake_in_emergency() {
    if (mode_ == role::merge || !radar_.sees(now_)) {
        return;
    }
    if (const auto deceleration = emergency_braking(self_, radar_.at(now_), setup_.limits.brake)) {
        command_ = std::min(command_, -*deceleration);
    }
}

void driver::lead(double dt) {
    command_ = cruise_ ? std::clamp(cruise_gain * (*cruise_ - self_.v), -cruise_limit, cruise_limit)
                       : setup_.plan.command(now_);
    if (radar_.sees(now_)) {
        command_ = std::min(command_, keep_time_gap(radar_.at(now_), full_time_gap, radar_.at(now_).a, dt));
    } else {
        time_gap_.reset();
    }
}

void driver::follow(double dt) {
    if (mode_ == role::radar) {
        radar_until_ = now_;
        time_gap_.reset();
    }
    if (opens_since_) {
        rejoin();
    }
    adjust_distance(dt);
    const auto mode_ahead = heard(ahead_)->last().mode;
    const bool broken = mode_ahead == role::fallback && lead_ != ahead_;
    const bool leader_silent = lead_ != ahead_ && silent(lead_);
    if (mode_ == role::merge) {
        if (has_room()) {
            enter(role::follow, "it changes into the lane behind " + ahead_);
        }
    } else if (lead_.empty() && leader_silent) {
        enter(role::degraded, ahead_ + " ahead does not report the leader");
    } else if (leader_silent || broken) {
        enter(role::degraded, leader_silent ? "the leader " + lead_ + " is silent" : ahead_ + " ahead has fallen back");
    } else {
        enter(role::follow, "receives " + ahead_ + " and " + lead_);
    }
    const bool leader_known = !leader_silent && heard(lead_) != nullptr;
    fade(setup_.uses_leader && !broken && (leader_known || reports_leader(ahead_)), dt);
    const auto ahead = reference_to(ahead_, distance_);
    command_ = law(ahead);
    heed_radar(ahead);
}

// The one ahead tells no leader, and nobody else does.
bool driver::knows_no_leader() const {
    const auto* who = heard(ahead_);
    return setup_.uses_leader && mode_ != role::merge && who != nullptr && !who->last().tells_lead &&
           setup_.leader.empty();
}

// Without a leader, errors would grow along the platoon at a constant distance.
void driver::follow_alone(double dt) {
    if (mode_ != role::degraded) {
        time_gap_.reset();
    }
    opens_since_.reset();
    lead_those_behind();
    enter(role::degraded, ahead_ + " ahead tells no leader: it keeps a time gap");
    auto rear = heard(ahead_)->at(now_);
    rear.x -= length_ahead();
    command_ = keep_time_gap(rear, lone_time_gap, rear.a, dt);
    distance_ = length_ahead() + kept_gap();
    heed_radar(reference_to(ahead_, distance_));
}

void driver::fade(bool leader_counts, double dt) {
    doubt_ = leader_counts ? 0 : doubt_ + dt;
    const double left = 1 - std::pow(doubt_ / fade_time, 3); // so that a short interruption changes almost nothing
    weight_ = leader_counts ? std::min(1.0, weight_ + dt / fade_time) : std::clamp(left, 0.0, std::max(0.0, weight_));
}

reference driver::reference_to(const std::string& name, double distance) const {
    const auto* who = heard(name);
    if (who == nullptr) {
        return {};
    }
    return {who->at(now_), who->command_at(now_), distance};
}

bool driver::reports_leader(const std::string& name) const {
    const auto* who = heard(name);
    return who != nullptr && !silent(name) && who->last().lead == lead_ && who->last().mode == role::follow &&
           who->last().from_leader.has_value();
}

std::optional<double> driver::from_leader(const motion& of, double behind, const std::string& name_ahead,
                                          const reference& ahead) const {
    const auto* leader = heard(lead_);
    const auto* who = reports_leader(name_ahead) ? heard(name_ahead) : nullptr;
    if (who != nullptr && misses(lead_) && (leader == nullptr || who->silence(now_) < leader->silence(now_))) {
        // The term contains q3 times the leader's acceleration, which nobody reports: all brake together, so it changes
        // about as the command of the vehicle that reports it.
        const double trend = setup_.law.q3 * who->last().j;
        return leader_part_via(setup_.law, of, ahead, *who->last().from_leader + trend * who->silence(now_));
    }
    return leader == nullptr ? std::nullopt : std::optional{leader_part(setup_.law, of, reference_to(lead_, behind))};
}

double driver::law(const reference& ahead) {
    const auto part = setup_.uses_leader ? from_leader(self_, behind_, ahead_, ahead) : std::nullopt;
    from_leader_ = part;
    return spacing_law(setup_.law, self_, ahead, part.value_or(0), part ? weight_ : 0);
}

// Only while the two ahead are related as they were when the one ahead reported, and both obey the law.
bool driver::may_infer(const state& ahead, const state& beyond) const {
    const bool obeys = beyond.mode == role::lead || beyond.mode == role::follow || beyond.mode == role::degraded ||
                       beyond.mode == role::radar;
    return setup_.uses_leader && to_beyond_ && ahead.mode == role::follow && obeys && beyond.lead == ahead.lead &&
           beyond.admits.empty() && !silent(beyond_) && (!silent(lead_) || reports_leader(beyond_));
}

// It obeys the same law, so that its command follows from what is ahead of it.
void driver::infer_ahead() {
    const auto* ahead = heard(ahead_);
    const auto* beyond = heard(beyond_);
    if (ahead == nullptr || beyond == nullptr || !misses(ahead_) || !may_infer(ahead->last(), beyond->last())) {
        return;
    }
    const auto where = ahead->at(now_);
    if (radar_.sees(now_)) {
        const auto seen = radar_.at(now_);
        refuted_ = refuted_ || std::abs(seen.x + length_ahead() - where.x) > refuting_error ||
                   std::abs(seen.v - where.v) > refuting_speed;
    }
    const auto what = reference_to(beyond_, *to_beyond_);
    const auto part = from_leader(where, ahead->last().behind, beyond_, what);
    if (part && !refuted_) {
        const double command = spacing_law(setup_.law, where, what, *part, 1);
        tracks_[ahead_].assume(std::clamp(command, -ahead->last().brake, setup_.limits.accelerate), now_);
        inferred_ = now_;
    }
}

double driver::wanted() const {
    const auto* who = heard(ahead_);
    if (who == nullptr) {
        return setup_.spacing;
    }
    const double spacing = setup_.spacing + who->last().length - usual_length;
    return wanted_distance(spacing, setup_.plan.speed, setup_.limits.brake, who->last().brake);
}

double driver::length_ahead() const {
    const auto* who = heard(ahead_);
    return who == nullptr ? usual_length : who->last().length;
}

void driver::adjust_distance(double dt) {
    const double before = distance_;
    const double room = makes_room_for_.empty() ? 0 : setup_.spacing;
    const double target = wanted() + room;
    if (distance_ < target) {
        distance_ = std::min(target, distance_ + close_up_speed * dt);
    } else if (now_ - radar_until_ > trust_after) {
        distance_ = std::max(target, distance_ - close_up_speed * dt);
    }
    behind_ += distance_ - before;
}

bool driver::has_room() const {
    const auto ahead = heard(ahead_)->at(now_);
    if (std::abs(ahead.x - self_.x - wanted()) > merge_tolerance || std::abs(ahead.v - self_.v) > merge_speed) {
        return false;
    }
    const auto* follower = heard(setup_.before);
    if (setup_.before.empty()) {
        return true;
    }
    return follower != nullptr && !silent(setup_.before) &&
           self_.x - follower->at(now_).x > setup_.spacing - merge_tolerance;
}

void driver::rejoin() {
    opens_since_.reset();
    measure_distance(*heard(ahead_), now_);
    choose_leader(heard(ahead_)->last());
}

void driver::follow_by_radar(double dt) {
    const auto* who = heard(ahead_);
    if (mode_ != role::radar) {
        radar_since_ = now_;
        time_gap_.reset();
        enter(role::radar, ahead_ + (who == nullptr   ? " ahead was never received: only the radar sees it"
                                     : silent(ahead_) ? " ahead is silent: only the radar sees it"
                                                      : " ahead is received too rarely: it follows by its radar"));
    }
    fade(setup_.uses_leader && lead_ != ahead_ && !silent(lead_) && heard(lead_) != nullptr, dt);
    // At first as before, because most interruptions are short, and an update that has just become old is more exact.
    auto seen = radar_.at(now_);
    seen.x += length_ahead();
    reference ahead{.where = seen, .command = seen.a, .distance = distance_};
    if (who != nullptr) {
        // What was inferred counts in full, but once the radar has refuted it, as little as if nothing had been.
        const double silent_since = now_ - who->silence(now_) + silent_after / setup_.hz;
        const double from = std::max({radar_since_, silent_since, refuted_ ? radar_since_ : inferred_});
        ahead = blend(reference_to(ahead_, distance_), ahead, std::clamp((now_ - from) / radar_share_time, 0.0, 1.0));
    }
    command_ = law(ahead);
    heed_radar(ahead);
    if (link_.is_poor() && !opens_since_) {
        opens_since_ = now_;
    }
    if (opens_since_) {
        open_gap(ahead.where.a, dt);
    }
}

void driver::open_gap(double acceleration_ahead, double dt) {
    lead_those_behind();
    const double share = std::min(1.0, (now_ - *opens_since_) / switch_time);
    command_ +=
        share * (keep_time_gap(radar_.at(now_), full_time_gap * link_.gap_share(), acceleration_ahead, dt) - command_);
    distance_ += share * (length_ahead() + kept_gap() - distance_);
}

/// What it keeps at its present time gap; behind a poor link, never less than it would otherwise.
double driver::kept_gap() const {
    const double least = mode_ == role::lead ? standstill_gap : wanted() - length_ahead();
    return std::max(least, standstill_gap + *time_gap_ * self_.v);
}

/// \param most s: up to this time gap it opens; a larger one stays as it is
double driver::keep_time_gap(const motion& rear, double most, double acceleration_ahead, double dt) {
    const double gap = rear.x - self_.x;
    const double pace = std::max(self_.v, standstill_gap);
    if (!time_gap_) {
        time_gap_ = std::clamp((gap - standstill_gap) / pace, 0.0, full_time_gap);
    }
    time_gap_ = std::max(*time_gap_, std::min(most, *time_gap_ + open_speed / pace * dt));
    const double error = gap - kept_gap();
    const double limited = std::clamp(error, -setup_.law.max_error, setup_.law.max_error);
    // The smaller the gap, the more of the acceleration ahead is fed forward.
    return (1 - *time_gap_ / full_time_gap) * acceleration_ahead +
           (rear.v - self_.v + radar_gain * limited) / std::max(*time_gap_, least_time_gap);
}

void driver::lead_those_behind() {
    if (lead_ != setup_.name) {
        lead_ = setup_.name;
        behind_ = 0;
        weight_ = 0;
    }
}

void driver::fall_back(double dt) {
    if (mode_ != role::fallback) {
        fallback_since_ = now_;
        enter(role::fallback,
              heard(ahead_) == nullptr ? ahead_ + " ahead was never received" : ahead_ + " ahead is silent");
    }
    const double since = now_ - fallback_since_;
    if (heard(ahead_) != nullptr && since <= lead_after) { // the normal command, reduced more and more
        const double as_before = law(reference_to(ahead_, distance_));
        command_ = std::max(as_before - fallback_growth * since * since, std::min(as_before, -fallback_brake));
    } else {
        // If it already brakes harder, it continues, because the one ahead may too.
        command_ = std::min(command_, std::max(command_ - fallback_jerk * dt, -fallback_brake));
    }
    if (since > lead_after) {
        lead_those_behind();
    }
}

state driver::report() const {
    // What the actuators carry out, if their limits cut off what the compensation of the lag commands.
    const double effective = self_.a + (applied_ - self_.a) * platoon_lag / setup_.limits.lag;
    const double most = most_leader_part(setup_.law, most_speed, most_acceleration);
    return {.mode = leaving_ ? role::leave : mode_,
            .ahead = ahead_,
            .lead = lead_,
            .admits = admits_,
            .behind = behind_,
            .t = now_,
            .x = self_.x,
            .v = self_.v,
            .a = self_.a,
            .u = effective,
            .j = trend_,
            .from_leader = from_leader_ ? std::optional{std::clamp(*from_leader_, -most, most)} : std::nullopt,
            .lag = platoon_lag,
            .brake = setup_.limits.brake,
            .length = setup_.limits.length};
}

} // namespace platoon
