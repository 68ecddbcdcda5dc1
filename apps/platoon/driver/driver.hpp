// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/link_quality.hpp"
#include "platoon/driver/manoeuvre.hpp"
#include "platoon/driver/radar_track.hpp"
#include "platoon/driver/spacing_law.hpp"
#include "platoon/driver/track.hpp"

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace platoon {

struct driver_setup {
    std::string name{};
    std::string ahead{};  ///< the vehicle it follows; empty: it leads
    std::string leader{}; ///< its leader, if the one ahead does not tell; empty: unknown then
    bool merges = false;  ///< it is in the next lane, and changes into the lane of the one ahead when there is a gap
    std::string before{}; ///< if it merges: the vehicle that makes room behind it; empty: nobody follows the one ahead
    double hz = 25;       ///< of updates, the same for all
    double spacing = 15;  ///< m, from front to front, behind a vehicle of the usual length
    bool uses_leader = true; ///< false: follows only the one ahead, for comparison
    motion start{};
    manoeuvre plan{}; ///< if it leads
    vehicle_limits limits{};
    radar_setup radar{};
    gains law{};
};

/// Controls one vehicle: its inputs are the updates of others, what its radar sees, and the time; its outputs are its
/// position and its own updates. It uses no clock and no network, so that the simulation and the process run the same
/// code. Times are local, in seconds.
class driver {
  public:
    /// After this many periods without an update a vehicle counts as silent: three are missed, and a quarter is the
    /// tolerance for a late one.
    static constexpr double silent_after = 3.25;

    driver(driver_setup setup, double now);

    /// The vehicles whose updates it needs, which depends on their updates.
    [[nodiscard]] std::set<std::string> needed() const;
    [[nodiscard]] bool needs(const std::string& name) const;
    /// Processes an update of one of those, and drops it if it is `implausible`. \param now the time of the last
    /// `step`, or a little later
    void receive(const std::string& from, const state& heard, double now);
    /// The clock of one of those differs by this, local time minus its own, s.
    void synchronise(const std::string& with, double difference);
    /// Advances to this time with the present command, then computes the next one.
    void step(double now);
    /// Processes what its radar saw. \param now the time of the last `step`, or a little later
    void measure(const echo& seen, double now);
    /// From now on its updates announce that it leaves.
    void leave();
    /// Its follower makes room for this vehicle, which merges behind this one.
    void admit(const std::string& name);
    /// It leads those behind it from now on, and falls back to a time gap behind the one ahead, which its radar sees.
    void split();

    /// Its update, as of the last step.
    [[nodiscard]] state report() const;
    [[nodiscard]] const motion& position() const noexcept { return self_; }
    /// To its actuators.
    [[nodiscard]] double command() const noexcept { return applied_; }
    [[nodiscard]] role mode() const noexcept { return mode_; }
    [[nodiscard]] double now() const noexcept { return now_; }
    [[nodiscard]] const vehicle_limits& limits() const noexcept { return setup_.limits; }
    [[nodiscard]] const std::string& ahead() const noexcept { return ahead_; }
    /// The vehicle that merges behind this one; empty: none.
    [[nodiscard]] const std::string& admits() const noexcept { return admits_; }
    /// To the one ahead, front to front.
    [[nodiscard]] double desired_distance() const noexcept { return distance_; }

    /// Called when the mode changes, with the reason.
    std::function<void(double now, role mode, const std::string& why)> on_change{};
    /// Called once for each reason why updates of a vehicle are dropped.
    std::function<void(double now, const std::string& from, const std::string& why)> on_drop{};

  private:
    void enter(role mode, const std::string& why);
    void lead(double dt);
    void follow(double dt);
    [[nodiscard]] bool knows_no_leader() const;
    void follow_alone(double dt);
    void follow_by_radar(double dt);
    void fall_back(double dt);
    void fade(bool leader_counts, double dt);
    void lead_those_behind();
    void infer_ahead();
    [[nodiscard]] double law(const reference& ahead);
    [[nodiscard]] reference reference_to(const std::string& name, double distance) const;
    /// The leader's term in the law of a vehicle. \param ahead what is ahead of it
    [[nodiscard]] std::optional<double> from_leader(const motion& of, double behind, const std::string& name_ahead,
                                                    const reference& ahead) const;
    [[nodiscard]] bool reports_leader(const std::string& name) const;
    [[nodiscard]] bool drops(const std::string& from, const state& told, double now);
    [[nodiscard]] bool may_infer(const state& ahead, const state& beyond) const;
    [[nodiscard]] double keep_time_gap(const motion& rear, double most, double acceleration_ahead, double dt);
    void open_gap(double acceleration_ahead, double dt);
    [[nodiscard]] double kept_gap() const;
    void rejoin();
    void heed_radar(const reference& ahead);
    void brake_in_emergency();
    [[nodiscard]] bool keeps_off() const;
    void measure_distance(const track& ahead, double now);
    [[nodiscard]] bool has_room() const;
    [[nodiscard]] double wanted() const;
    [[nodiscard]] double length_ahead() const;
    [[nodiscard]] double ahead_behind_leader(const state& of_ahead);
    void adjust_distance(double dt);
    void take_over(const state& from);
    void choose_leader(const state& of_ahead);
    [[nodiscard]] bool silent(const std::string& name) const;
    [[nodiscard]] bool misses(const std::string& name) const;
    [[nodiscard]] const track* heard(const std::string& name) const;

    driver_setup setup_;
    motion self_;
    double command_ = 0, trend_ = 0;
    double applied_ = 0; ///< what the actuators are commanded
    double now_, began_;
    role mode_ = role::follow;
    bool leaving_ = false;
    std::string ahead_, next_, lead_;   ///< `next_`: the one ahead after the present one has left
    std::string beyond_;                ///< the one ahead of the one ahead
    std::string admits_;                ///< the vehicle that merges behind this one ...
    double admits_until_ = 0;           ///< ... and when it is given up, or is in the lane
    std::string makes_room_for_;        ///< the vehicle that merges ahead of this one
    double distance_;                   ///< desired distance to the one ahead, which slowly approaches `wanted`
    double behind_ = 0;                 ///< desired distance to the leader
    std::optional<double> apart_;       ///< distance of the one ahead to the leader, if it does not tell, on average
    double weight_ = 0;                 ///< of the leader
    double doubt_ = 0;                  ///< s, for which it has not counted
    std::optional<double> from_leader_; ///< its term in the law, if it has one
    double inferred_ = -1e9;            ///< when the one ahead was inferred from others last
    bool refuted_ = false;              ///< by the radar, since its last update
    std::optional<double> to_beyond_;   ///< desired distance of the one ahead to the one beyond, of its last update
    double fallback_since_ = 0;
    double radar_since_ = 0, radar_until_ = -1e9;
    link_quality link_;                 ///< to the one ahead
    std::optional<double> opens_since_; ///< when it began to open the gap, because that link is poor
    std::optional<double> time_gap_;    ///< s, that it keeps by radar at present
    std::optional<double> cruise_;      ///< m/s, if it leads without a plan
    radar_track radar_;
    std::map<std::string, track> tracks_;
    std::set<std::string> dropped_; ///< the reasons, with the vehicle
};

} // namespace platoon
