// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace dsgd {

/// Whether a training has converged, and how good its result is, from the accuracies that were measured meanwhile. Of
/// an accuracy, 0.01 is a point.
class convergence {
  public:
    /// The last accuracies that are compared are so many of all, and those before them, but not fewer than `least`.
    static constexpr std::size_t share = 4;
    static constexpr std::size_t least = 3;
    /// It has not converged if the last ones are so much better than those before them on average, ...
    static constexpr double still_better = 0.0075;
    /// ... or if they differ so much among each other.
    static constexpr double unsteady = 0.03;

    void add(double accuracy) { accuracies_.push_back(accuracy); }
    [[nodiscard]] double last() const { return accuracies_.empty() ? 0 : accuracies_.back(); }

    /// What is wrong with the result, for people; empty if it is good: converged, and not more than a point below the
    /// best.
    /// \param best the best accuracy that is known, 0 to 1; none: not known
    [[nodiscard]] std::string shortcoming(std::optional<double> best) const;

  private:
    [[nodiscard]] std::string not_converged() const;

    std::vector<double> accuracies_{};
};

} // namespace dsgd
