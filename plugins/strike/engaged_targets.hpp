// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "engagement.hpp"
#include "own_sensor.hpp"
#include "target_filter.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace strike {

/// Targets of orders that are followed with the own sensor: those for which weapons were released, so that none is
/// attacked again by mistake, and those of orders that are held. One that is not seen any more is forgotten.
class engaged_targets {
  public:
    /// After that time without a plot, s.
    static constexpr double lost_s = 5;

    /// \param now when the target of that order was there
    void add(std::string order, const target_filter& target, double now);
    /// How many scans `follow` needs now, 600 at most.
    [[nodiscard]] std::uint64_t scans_needed(double now) const;
    /// \param scans oldest first; the oldest ones may be known already
    void follow(const std::vector<scan>& scans, double now);
    void remove(const std::string& order);
    /// The target of that order now; nothing, if it is not followed any more.
    [[nodiscard]] std::optional<target_filter> at(const std::string& order, double now) const;
    /// The order whose target this one is.
    [[nodiscard]] std::optional<std::string> find(const target_filter& target, double now) const;

  private:
    struct engaged {
        std::string order;
        target_filter target;
        double utc = 0;      ///< at which it was there
        double seen_utc = 0; ///< of its last plot
    };

    std::vector<engaged> all_;
};

} // namespace strike
