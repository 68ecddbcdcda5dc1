// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "motion.hpp"

#include <boost/describe/class.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

namespace platoon {

/// What became of a platoon: `error[i]` is the largest error of the distance between vehicles i and i+1.
struct verdict {
    std::vector<double> error{}; ///< m
    double string_ratio = 0;     ///< the largest of error[i+1]/error[i]: at most 1 where errors do not grow
    double least_gap = NAN;      ///< m, from bumper to bumper; NaN (null) where no two were seen at one time
    bool collision = false;
};
BOOST_DESCRIBE_STRUCT(verdict, (), (error, string_ratio, least_gap, collision))

/// Looks at where all vehicles are at the same times.
class assessment {
  public:
    assessment(std::size_t vehicles, double spacing, double length);

    /// Where they are, the leader first.
    void sample(const std::vector<motion>& where);
    [[nodiscard]] const verdict& result() const noexcept { return result_; }

  private:
    double spacing_, length_;
    verdict result_;
};

/// The least gap between two of those that drive one behind the other, from bumper to bumper; NaN where there are no
/// two.
double least_gap(std::vector<motion> where, double length);

/// The distance that is there less the one that is wanted, of each vehicle but the first.
std::vector<double> spacing_errors(const std::vector<motion>& where, double spacing);

} // namespace platoon
