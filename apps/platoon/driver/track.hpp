// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/state.hpp"

#include <optional>

namespace platoon {

/// The position of another vehicle: its last update, extrapolated to the present by the model of a vehicle, so that a
/// lost update makes little difference.
class track {
  public:
    /// \param now local time, s
    /// \return false if a newer update has been received before, or this one
    bool receive(const state& heard, double now);
    /// Its clock differs by this, local time minus its own, s. Before this is known, the fastest update counts as one
    /// that took no time; the same if the updates contradict it, or it is no number.
    void set_difference(double local_minus_its) noexcept { difference_ = local_minus_its; }
    [[nodiscard]] bool known() const noexcept { return last_.has_value(); }
    [[nodiscard]] const state& last() const noexcept { return *last_; }
    /// How long it has been silent, by local time alone.
    [[nodiscard]] double silence(double now) const noexcept { return now - received_; }
    /// It has sent no update, but what others report shows that it commands this acceleration now.
    void assume(double command, double now);
    /// The acceleration that it commands now, by extrapolation.
    [[nodiscard]] double command_at(double now) const;
    /// Its motion now, by extrapolation.
    [[nodiscard]] motion at(double now) const;

  private:
    [[nodiscard]] double age(double now) const;
    [[nodiscard]] double offset() const;

    std::optional<state> last_;
    state base_{};        ///< from which its motion is extrapolated: the last update, or what has been assumed since
    double received_ = 0; ///< when the last update arrived
    double offset_ = 0;   ///< local time minus the sender's, for the fastest update
    std::optional<double> difference_; ///< the same of the clocks, if it was measured
};

} // namespace platoon
