// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace platoon {

/// How well the updates of the vehicle ahead arrive: for how much of the last seconds its latest one was too old to
/// rely on. A poor link requires a larger gap.
class link_quality {
  public:
    /// \param now local time, s, from which on updates should arrive
    explicit link_quality(double now) : stepped_(now), received_(now) {}

    /// An update has arrived.
    void receive(double now) noexcept { received_ = now; }
    /// Time has passed.
    void step(double now);

    /// For how long the latest update was too old, s, of which less and less counts as it lies in the past.
    [[nodiscard]] double silence() const noexcept { return silence_; }
    /// Whether to follow by the radar until it is better.
    [[nodiscard]] bool is_poor() const noexcept { return poor_; }
    /// How much of the full time gap it requires, from 0 to 1.
    [[nodiscard]] double gap_share() const;

  private:
    double stepped_, received_;
    double silence_ = 0;
    bool poor_ = false;
};

} // namespace platoon
