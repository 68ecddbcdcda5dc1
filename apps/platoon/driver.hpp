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
    std::string ahead{};     ///< whom it follows; empty: it leads
    double hz = 25;          ///< of updates, everybody's
    double spacing = 15;     ///< m, from front to front
    bool uses_leader = true; ///< false: follows the one ahead alone, for comparison
    motion start{};
    manoeuvre plan{}; ///< where it leads
    vehicle_limits limits{};
    gains law{};
};

/// Drives one vehicle: what it is told by others and the time go in, where it is and what it tells others come out.
/// No clock, no network: the simulation and the process on the road run the same. Times are local, in seconds.
class driver {
  public:
    /// After so many periods without an update somebody counts as silent: the third is missed, and a quarter is for
    /// one that is only late.
    static constexpr double silent_after = 3.25;

    driver(driver_setup setup, double now);

    /// Whose updates it has to hear. Changes with what they say.
    [[nodiscard]] std::set<std::string> wanted() const;
    [[nodiscard]] bool wants(const std::string& whom) const;
    /// An update of one of those has come. \param to the time for which `step` was called last, or a little later
    void take(const std::string& from, const state& heard, double now);
    /// Drives to this time with the present command, then decides on the next one.
    void step(double now);
    /// From now on it tells that it leaves.
    void leave();

    /// What it tells others, as of the last step.
    [[nodiscard]] state report() const;
    [[nodiscard]] const motion& where() const noexcept { return self_; }
    [[nodiscard]] double command() const noexcept { return command_; }
    [[nodiscard]] role mode() const noexcept { return mode_; }
    [[nodiscard]] double now() const noexcept { return now_; }

    /// Is told when the mode changes, and why.
    std::function<void(double now, role mode, const std::string& why)> on_change{};

  private:
    void enter(role mode, const std::string& why);
    void follow(double dt);
    void fall_back(double dt);
    [[nodiscard]] double law(double weight) const;
    void close_up(double dt);
    void take_over(const state& from);
    void choose_leader(const state& of_ahead);
    [[nodiscard]] bool silent(const std::string& whom) const;
    [[nodiscard]] const track* heard(const std::string& whom) const;

    driver_setup setup_;
    motion self_;
    double command_ = 0, trend_ = 0;
    double now_, began_;
    role mode_ = role::follow;
    bool leaving_ = false;
    std::string ahead_, next_, lead_; ///< `next_`: who will be ahead when the one who is has left
    double distance_;                 ///< to the one ahead, as wanted now: it closes up slowly to `setup.spacing`
    double behind_ = 0;               ///< the leader, as wanted now
    double weight_ = 0;               ///< of the leader
    double doubt_ = 0;                ///< s, for which it has not counted
    double fallback_since_ = 0;
    std::map<std::string, track> tracks_;
};

} // namespace platoon
