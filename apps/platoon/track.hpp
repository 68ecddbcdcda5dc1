// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "state.hpp"

#include <optional>

namespace platoon {

/// What is known of another vehicle: its last update, carried on to the present by the model of a vehicle, so that an
/// update that was lost is hardly missed.
class track {
  public:
    explicit track(double lag) : lag_(lag) {}

    /// \param now local time, s
    void take(const state& heard, double now);
    [[nodiscard]] bool known() const noexcept { return last_.has_value(); }
    [[nodiscard]] const state& last() const noexcept { return *last_; }
    /// How long it has been silent, by local time alone.
    [[nodiscard]] double silence(double now) const noexcept { return now - received_; }
    /// The acceleration that it commands now, if that went on to change as it did.
    [[nodiscard]] double command_at(double now) const;
    /// Where it is now, if its command went on to change as it did.
    [[nodiscard]] motion at(double now) const;

  private:
    [[nodiscard]] double age(double now) const;

    double lag_;
    std::optional<state> last_;
    double received_ = 0; ///< when the last came
    double offset_ = 0;   ///< local time less the sender's, for an update that came as fast as any
};

} // namespace platoon
