// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/clock_difference.hpp"
#include "platoon/driver/driver.hpp"
#include "platoon/driver/joining.hpp"
#include "platoon/driver/localization.hpp"
#include "platoon/driver/radar.hpp"
#include "platoon/driver/vehicle_report.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

namespace platoon {

struct vehicle_setup {
    driver_setup driving{};
    std::size_t turn = 0, turns = 1; ///< the slot of each period in which it sends
    double start_utc = 0;            ///< UTC at the local time 0, s since 1970
    std::uint64_t seed = 1;          ///< of its radar
    dialect tells = dialect::current;
    bool separate_truth = false; ///< what its radar sees comes by another link than the updates that it drives by
};

/// A vehicle as its node needs it: whose states to bind, what to publish and when, and how to answer requests. Its
/// inputs are what feeds deliver, requests and the time; it uses no clock and no network, so that the simulation of
/// nodes runs the same code as the program. Times are local, in seconds.
///
/// Its radar is simulated: it measures true positions, which are updates that no fault has affected. If no more of them
/// arrive, that vehicle's process has ended, and its brakes apply by themselves.
class vehicle {
  public:
    explicit vehicle(vehicle_setup setup);
    vehicle(const vehicle&) = delete;
    vehicle& operator=(const vehicle&) = delete;
    ~vehicle() = default;

    [[nodiscard]] const vehicle_setup& setup() const noexcept { return setup_; }
    [[nodiscard]] const std::string& name() const noexcept { return report_.vehicle; }
    /// Starts to drive. \param driving its setup, with its position now
    void begin(const driver_setup& driving, double now);
    /// Null before it has begun.
    [[nodiscard]] const driver* who() const noexcept { return driver_ ? &*driver_ : nullptr; }

    /// When it decides next. \pre it has begun
    [[nodiscard]] double next() const noexcept;
    /// Measures and decides, and returns its update, if it is time for one. \pre it has begun
    std::optional<state_message> decide();
    /// Whether it has left the platoon.
    [[nodiscard]] bool has_left(double now) const noexcept { return left_at_ && now >= *left_at_; }

    /// The vehicles whose `state` has to be bound in the group at present.
    [[nodiscard]] std::set<std::string> bound_to() const;
    [[nodiscard]] bool is_bound_to(const std::string& name) const;
    /// The vehicle ahead in the lane, which its radar sees, also if it is not followed any more; empty: none. Its true
    /// positions are needed.
    [[nodiscard]] const std::string& seen() const noexcept { return seen_; }
    /// An update has arrived in the group. \param repeated it was sent again for this vehicle's BIND, and may be older
    /// \return whether it was sent during the drive, and so counts
    bool receive(const std::string& from, const state_message& told, double now, bool repeated);
    /// The node reports that updates in the group are missing.
    void note_gap(std::uint64_t missed, double now);
    /// Those whose clocks are to be asked for now, by PULL `clock`, each once.
    std::set<std::string> clocks_to_ask(double now);
    /// One has answered. \param utc what it said \param sent, received local times
    void note_clock(const std::string& of, double sent, double utc, double received);
    /// One has answered that it has no such task.
    void note_no_clock(const std::string& of, double now);
    /// UTC by its own clock.
    [[nodiscard]] double utc(double now) const noexcept { return setup_.start_utc + now; }
    /// An update that no fault has affected.
    void see(const std::string& which, const state_message& told);
    /// How long an update has taken.
    void note_latency(double microseconds);

    /// Lets a follower join behind it. \return why it cannot do so now; empty: it does
    std::string accept_follower(const join_request& who, double now);
    /// It leads those behind it from now on. \return why it cannot; empty: it does
    std::string split();
    /// It announces that it leaves, and has left a moment later.
    void leave(double now);

    /// Something to be recorded and told.
    void note(double at, const std::string& mode, const std::string& why);
    /// Called for each of those.
    std::function<void(const event& what)> on_note{};
    [[nodiscard]] const vehicle_report& report() const noexcept { return report_; }

  private:
    void measure(double at);

    struct clock {
        clock_difference difference{};
        double ask_at = 0; ///< when next
    };

    vehicle_setup setup_;
    std::int64_t decisions_, echoes_;
    double first_, pace_;    ///< when it would have decided first, and the time between two decisions
    std::int64_t count_ = 0; ///< of its next decision
    radar sensor_;
    std::optional<driver> driver_;
    std::map<std::string, state> truth_;  ///< of each of the others
    std::map<std::string, clock> clocks_; ///< the same
    std::string seen_;
    std::string follower_; ///< the vehicle that joined behind, at `followed_at_`
    double followed_at_ = 0;
    std::optional<double> left_at_; ///< when it will have left
    vehicle_report report_;
};

/// Each purpose has random numbers of its own.
std::uint64_t seed_for(const std::string& purpose, std::uint64_t seed);

} // namespace platoon
