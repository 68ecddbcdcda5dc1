// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "manoeuvre.hpp"
#include "spacing_law.hpp"
#include "track.hpp"

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace platoon {

struct driver_setup {
    std::string name{};
    std::string ahead{};     ///< the vehicle it follows; empty: it leads
    double hz = 25;          ///< of updates, the same for all
    double spacing = 15;     ///< m, from front to front
    bool uses_leader = true; ///< false: follows only the one ahead, for comparison
    motion start{};
    manoeuvre plan{}; ///< if it leads
    vehicle_limits limits{};
    gains law{};
};

/// Controls one vehicle: its inputs are the updates of others and the time; its outputs are its position and its own
/// updates. It uses no clock and no network, so that the simulation and the process run the same code. Times are local,
/// in seconds.
class driver {
  public:
    /// After this many periods without an update a vehicle counts as silent: three are missed, and a quarter is the
    /// tolerance for a late one.
    static constexpr double silent_after = 3.25;

    driver(driver_setup setup, double now);

    /// The vehicles whose updates it needs, which depends on their updates.
    [[nodiscard]] std::set<std::string> needed() const;
    [[nodiscard]] bool needs(const std::string& name) const;
    /// Processes an update of one of those. \param now the time of the last `step`, or a little later
    void receive(const std::string& from, const state& heard, double now);
    /// Advances to this time with the present command, then computes the next one.
    void step(double now);
    /// From now on its updates announce that it leaves.
    void leave();

    /// Its update, as of the last step.
    [[nodiscard]] state report() const;
    [[nodiscard]] const motion& position() const noexcept { return self_; }
    [[nodiscard]] double command() const noexcept { return command_; }
    [[nodiscard]] role mode() const noexcept { return mode_; }
    [[nodiscard]] double now() const noexcept { return now_; }

    /// Called when the mode changes, with the reason.
    std::function<void(double now, role mode, const std::string& why)> on_change{};

  private:
    void enter(role mode, const std::string& why);
    void follow(double dt);
    void fall_back(double dt);
    [[nodiscard]] double law(double weight) const;
    void close_up(double dt);
    void take_over(const state& from);
    void choose_leader(const state& of_ahead);
    [[nodiscard]] bool silent(const std::string& name) const;
    [[nodiscard]] const track* heard(const std::string& name) const;

    driver_setup setup_;
    motion self_;
    double command_ = 0, trend_ = 0;
    double now_, began_;
    role mode_ = role::follow;
    bool leaving_ = false;
    std::string ahead_, next_, lead_; ///< `next_`: the one ahead after the present one has left
    double distance_;                 ///< desired distance to the one ahead, which slowly approaches `setup.spacing`
    double behind_ = 0;               ///< desired distance to the leader
    double weight_ = 0;               ///< of the leader
    double doubt_ = 0;                ///< s, for which it has not counted
    double fallback_since_ = 0;
    std::map<std::string, track> tracks_;
};

} // namespace platoon
