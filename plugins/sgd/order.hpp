// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "classifier.hpp"
#include "data_set.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace sgd {

/// The body of DELEGATE sgd/train: which points, and how.
struct order {
    std::uint64_t first = 0;
    std::uint64_t count = 0;               ///< from `first` on
    std::optional<std::uint64_t> epochs{}; ///< steps per point; default 1
    std::optional<double> rate{};          ///< 1e-4 unless set
    std::optional<std::uint64_t> seed{};   ///< of the draws; 1 unless set
    std::optional<recipe> data{};          ///< refused where the node has other data
    std::optional<classifier> start{};     ///< w0 of the paper's Algorithm 1; zero unless set
};
BOOST_DESCRIBE_STRUCT(order, (), (first, count, epochs, rate, seed, data, start))

/// Its answer.
struct trained {
    std::string node{}; ///< that did it
    classifier result{};
    std::uint64_t points = 0;
    std::uint64_t steps = 0;
    double ms = 0; ///< that the descent itself took, by the node's own clock
    /// When it had arrived, by the requester's clock, since the beginning of all. The requester adds it.
    std::optional<double> after_ms{};
};
BOOST_DESCRIBE_STRUCT(trained, (), (node, result, points, steps, ms, after_ms))

} // namespace sgd
