// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "data_set.hpp"

#include <boost/describe/class.hpp>

#include <array>
#include <cmath>

namespace sgd {

/// A linear classifier: a point is of class 1 where its value is over 1/2.
struct classifier {
    std::array<double, 2> weights{};
    double bias = 0;

    [[nodiscard]] double value(const point& p) const noexcept { return weights[0] * p.x + weights[1] * p.y + bias; }
    bool operator==(const classifier&) const = default;
};
BOOST_DESCRIBE_STRUCT(classifier, (), (weights, bias))

inline constexpr const char* diverged = "it does not converge: the rate is too large";
/// False if a descent has left all bounds, because the rate was too large.
inline bool is_finite(const classifier& c) noexcept {
    return std::isfinite(c.weights[0]) && std::isfinite(c.weights[1]) && std::isfinite(c.bias);
}

/// The mean of (value - label)^2: what the paper reports, and what the descent makes small.
double mean_squared_error(const data_set& data, const classifier& c);

/// The classifier with the least mean-squared error that any linear one can have on this data, from the normal
/// equations: what a descent is to be measured by.
classifier least_squares(const data_set& data);

/// How good a classifier is.
struct quality {
    double mse = 0;       ///< mean-squared error
    double least_mse = 0; ///< that of `least_squares`
    double wrong = 0;     ///< the part of the points that it puts into the wrong class, 0 to 1
};
BOOST_DESCRIBE_STRUCT(quality, (), (mse, least_mse, wrong))

quality judge(const data_set& data, const classifier& c);

} // namespace sgd
