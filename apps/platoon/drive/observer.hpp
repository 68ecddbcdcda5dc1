// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/drive/logbook.hpp"
#include "platoon/driver/spacing_law.hpp"
#include "platoon/driver/state.hpp"
#include "platoon/driver/vehicle_report.hpp"

#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace platoon {

/// Who is on the road, from the states that are received: any vehicle, of whatever process or host. It uses no clock
/// and no network.
class observer {
  public:
    /// Of more, those are forgotten that are silent, or the new ones are not heard.
    static constexpr std::size_t most_vehicles = 64;
    /// Of one vehicle's changes in so many seconds, only so many are told.
    static constexpr int most_changes = 10;
    static constexpr double change_period = 10;

    explicit observer(const gains& law) : law_(law) {}

    /// A state has arrived. \return what has changed: a vehicle has another mode, or is there again
    std::optional<event> take(const std::string& from, const state& told, double now);
    /// A process has ended. \param left as planned
    void record_end(const std::string& vehicle, bool left) { book_.record_end(vehicle, left); }
    /// Records the end of those of which nothing has arrived for this time, s, unless that has been recorded, or they
    /// are among `except`. If one of them is received later, it is there again.
    std::vector<event> end_silent(double now, double longest, const std::set<std::string>& except = {});

    [[nodiscard]] const logbook& book() const noexcept { return book_; }
    /// All that have been there.
    [[nodiscard]] std::vector<std::string> vehicles() const;
    /// Those in the lane at that time, from the front to the rear.
    [[nodiscard]] std::vector<std::string> lane(double t) const;
    /// Their desired distances to the one ahead, if they keep `spacing` at this speed; that of the first is 0.
    [[nodiscard]] std::vector<double> desired(const std::vector<std::string>& lane, double spacing, double speed) const;

  private:
    struct one_heard {
        double heard = 0;         ///< when it was received last
        double since = -INFINITY; ///< when the period began in which these have changed
        int changes = 0;
    };
    [[nodiscard]] bool has_room_for(const std::string& name);

    gains law_;
    logbook book_;
    std::map<std::string, one_heard> vehicles_;
    std::set<std::string> silent_;
};

} // namespace platoon
