// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace sgd {

inline constexpr std::uint64_t most_per_class = 10'000'000;

struct point {
    double x = 0, y = 0;
};

/// What a data set is made from: the same recipe gives the same points everywhere, so that none has to travel.
struct recipe {
    std::uint64_t seed = 1;
    std::uint64_t per_class = 100'000; ///< points of each class, 1 to `most_per_class`
    double separation = 7;             ///< from the mean of one class to that of the other; each has the variance 1

    bool operator==(const recipe&) const = default;
};
BOOST_DESCRIBE_STRUCT(recipe, (), (seed, per_class, separation))

/// For people: "100000 points per class, 7 apart, from seed 1".
std::string to_string(const recipe& r);

/// Two classes of points in the plane, normally distributed about one mean each (paper, section 4.2 and Fig. 5). The
/// classes take turns, so that any stretch of it holds as many of one as of the other.
class data_set {
  public:
    /// \throws std::invalid_argument if the number of points is out of range
    explicit data_set(const recipe& from);

    [[nodiscard]] const recipe& made_from() const noexcept { return recipe_; }
    [[nodiscard]] std::size_t size() const noexcept { return points_.size(); }
    [[nodiscard]] const point& operator[](std::size_t i) const noexcept { return points_[i]; }
    /// The class of the point: 0 or 1.
    [[nodiscard]] static double label(std::size_t i) noexcept { return static_cast<double>(i % 2); }

  private:
    recipe recipe_;
    std::vector<point> points_;
};

} // namespace sgd
