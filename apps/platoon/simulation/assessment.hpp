// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"

#include <boost/describe/class.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

namespace platoon {

/// A string ratio up to this one counts as stable. It is above 1 because of the noise that losses add to the errors.
inline constexpr double stable_ratio = 1.02;

/// The result of a drive: `error[i]` is the largest error of the distance between vehicles i and i+1.
struct verdict {
    std::vector<double> error{}; ///< m
    double string_ratio = 0;     ///< the largest of error[i+1]/error[i]: at most 1 if errors do not grow
    /// The largest error divided by error[0]: at most 1 if no error is larger than that behind the leader. Unlike the
    /// errors of neighbours, this may be compared if vehicles differ.
    /// NaN (null) if error[0] is below 1 cm.
    double first_ratio = NAN;
    /// The largest acceleration of a follower divided by that of the leader; NaN (null) if that is below 0.1 m/s².
    double acceleration_ratio = NAN;
    double least_gap = NAN; ///< m, from bumper to bumper; NaN (null) if no two were present at the same time
    bool collision = false;
};
BOOST_DESCRIBE_STRUCT(verdict, (), (error, string_ratio, first_ratio, acceleration_ratio, least_gap, collision))

/// Evaluates the positions of all vehicles at the same times.
class assessment {
  public:
    assessment(std::size_t vehicles, double spacing, double length);

    /// Their positions, the leader first, each at the same desired distance to the one ahead.
    void sample(const std::vector<motion>& where);
    /// The same with a desired distance of each, of which the leader's does not count. If vehicles have joined or left,
    /// only the gaps between those in the lane count.
    void sample(const std::vector<motion>& where, const std::vector<double>& desired);
    [[nodiscard]] const verdict& result() const noexcept { return result_; }

  private:
    double spacing_, length_;
    verdict result_;
    double of_leader_ = 0, of_others_ = 0; ///< the largest accelerations, m/s²
};

/// The smallest gap between two successive vehicles, from bumper to bumper; NaN if there are not two.
double least_gap(std::vector<motion> where, double length);

/// The actual distance minus the desired one, of each vehicle but the first.
std::vector<double> spacing_errors(const std::vector<motion>& where, double spacing);

} // namespace platoon
