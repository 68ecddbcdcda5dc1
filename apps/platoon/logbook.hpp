// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "motion.hpp"
#include "state.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace platoon {

/// What each vehicle told in the course of a drive, and so where each was at any time of it.
class logbook {
  public:
    explicit logbook(double lag) : lag_(lag) {}

    void take(const std::string& vehicle, const state& told);
    /// Its process has gone at that time. \param left in good order: it is not on the lane any more; otherwise it stays
    /// there, and its brakes apply
    void gone(const std::string& vehicle, bool left);
    /// Nothing before its first state and after it has left.
    [[nodiscard]] std::optional<motion> where(const std::string& vehicle, double t) const;
    /// The last it told; null: nothing yet.
    [[nodiscard]] const state* last(const std::string& vehicle) const;
    [[nodiscard]] bool has_gone(const std::string& vehicle) const { return gone_.contains(vehicle); }
    [[nodiscard]] bool has_left(const std::string& vehicle) const;

  private:
    double lag_;
    std::map<std::string, std::vector<state>> told_; ///< of each, in the order of time
    std::map<std::string, bool> gone_;               ///< whether by leaving
};

} // namespace platoon
