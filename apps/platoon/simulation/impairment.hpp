// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/random_source.hpp"
#include "platoon/simulation/gilbert_elliott.hpp"

#include <optional>

namespace platoon {

/// A bad radio link from one vehicle to another: it loses some updates and delays the others, determined by a seed.
class impairment {
  public:
    /// \param delay s, the maximum delay; the minimum is half of it
    impairment(const gilbert_elliott& losses, double delay, std::uint64_t seed)
        : losses_(losses), delay_(delay), random_(seed),
          bad_(losses.to_bad > 0 && random_.uniform() < losses.bad_share()) {}

    /// The delay of the next update; nothing: it is lost.
    std::optional<double> next() {
        if (losses_.to_bad > 0) {
            bad_ = random_.uniform() < (bad_ ? 1 - losses_.to_good : losses_.to_bad);
        }
        const bool lost = random_.uniform() < (bad_ ? losses_.bad_loss : losses_.good_loss);
        const double later = delay_ * (0.5 + random_.uniform() / 2);
        return lost ? std::nullopt : std::optional{later};
    }

  private:
    gilbert_elliott losses_;
    double delay_;
    random_source random_;
    bool bad_;
};

} // namespace platoon
