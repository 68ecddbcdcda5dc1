// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"
#include "platoon/driver/state.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace platoon {

/// The updates of each vehicle during a drive, and therefore its position at any time.
class logbook {
  public:
    static constexpr double longest = 600;   ///< s, which it has of each vehicle; older updates are forgotten
    static constexpr double closest = 0.005; ///< s; what follows an update sooner does not count

    void add(const std::string& vehicle, const state& told);
    /// Nothing is known of it any more.
    void forget(const std::string& vehicle);
    /// Its process has ended. \param left as planned: it is no longer on the lane; otherwise it stays there, and brakes
    void record_end(const std::string& vehicle, bool left);
    /// It had not.
    void record_return(const std::string& vehicle);
    /// Nothing before its first update, while it is in the next lane, and after it has left.
    [[nodiscard]] std::optional<motion> position(const std::string& vehicle, double t) const;
    /// As of its last update before that time; `lead` before the first.
    [[nodiscard]] role mode(const std::string& vehicle, double t) const;
    /// Its last update, or null.
    [[nodiscard]] const state* last(const std::string& vehicle) const;
    [[nodiscard]] bool has_ended(const std::string& vehicle) const { return ended_.contains(vehicle); }
    [[nodiscard]] bool has_left(const std::string& vehicle) const;

  private:
    std::map<std::string, std::vector<state>> states_; ///< of each, in the order of time
    std::map<std::string, bool> ended_;                ///< whether by leaving
};

} // namespace platoon
