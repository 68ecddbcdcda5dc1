// SPDX-License-Identifier: BSL-1.0
#include "convergence.hpp"

#include "dsgd/verdict.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>

namespace dsgd {
namespace {

std::string percent(double accuracy) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.2f %%", accuracy * 100);
    return text.data();
}

} // namespace

std::string convergence::shortcoming(std::optional<double> best) const {
    std::string worse;
    if (best && last() < *best - tolerated) {
        worse = "the result is not good: its accuracy is " + percent(last()) + ", and " + percent(*best) +
                " is known to be possible";
    }
    const auto doubt = not_converged();
    return worse + (worse.empty() || doubt.empty() ? "" : "; ") + doubt;
}

std::string convergence::not_converged() const {
    const auto count = std::max(least, accuracies_.size() / share);
    if (accuracies_.size() < 2 * count) {
        return "it is not known whether the training has converged: the accuracy was measured " +
               std::to_string(accuracies_.size()) + " times, which takes at least " + std::to_string(2 * least);
    }
    const auto end = accuracies_.end();
    const auto late = end - static_cast<std::ptrdiff_t>(count);
    const auto before = late - static_cast<std::ptrdiff_t>(count);
    const auto mean = [&](auto from, auto to) { return std::accumulate(from, to, 0.0) / static_cast<double>(count); };
    const auto gain = mean(late, end) - mean(before, late);
    const auto told =
        "the training has not converged: in the last " + std::to_string(count) + " measurements, the accuracy ";
    if (gain > still_better) {
        return told + "is " + percent(gain) + " higher than in as many before";
    }
    const auto [lowest, highest] = std::minmax_element(late, end);
    if (*highest - *lowest > unsteady) {
        return told + "goes from " + percent(*lowest) + " to " + percent(*highest);
    }
    return {};
}

} // namespace dsgd
