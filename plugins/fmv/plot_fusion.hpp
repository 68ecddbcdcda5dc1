// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "camera_error.hpp"
#include "ground_radar.hpp"
#include "messages.hpp"
#include "stream.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace fmv {

/// Fuses the tracks of one video with the plots of the satellite's own radar: the video says which targets there are,
/// and how they move; the plots say by how much all their places are wrong.
class plot_fusion {
  public:
    /// \param seed of the traffic that the radar sees
    explicit plot_fusion(std::uint64_t seed) : radar_(seed) {}

    /// Corrects the tracks after a frame. \return by what; nothing, if it is not known (yet): then they are as they
    /// were
    std::optional<place_shift> correct(std::vector<track>& tracks, const stream::place_error& of, double utc);

  private:
    void look(const std::vector<track>& tracks, double utc);

    ground_radar radar_;
    std::optional<camera_error> error_; ///< of the present map
    std::uint64_t map_ = 0;
    double looked_ = 0; ///< when the last scan was that has been taken
};

} // namespace fmv
