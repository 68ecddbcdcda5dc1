// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace tool {

inline double microseconds(std::chrono::nanoseconds span) { return static_cast<double>(span.count()) / 1e3; }

/// To three decimals: no more than the measurement is good for.
inline double rounded(double value) { return std::round(value * 1e3) / 1e3; }

/// The median of each figure over the passes.
template <class Figures>
class medians {
  public:
    explicit medians(const std::vector<Figures>& passes) : passes_(passes) {}

    double operator()(double Figures::*figure) const {
        std::vector<double> values;
        for (const auto& pass : passes_) {
            values.push_back(pass.*figure);
        }
        return median(std::move(values));
    }
    std::optional<double> operator()(std::optional<double> Figures::*figure) const {
        std::vector<double> values;
        for (const auto& pass : passes_) {
            if (pass.*figure) {
                values.push_back(*(pass.*figure));
            }
        }
        return values.empty() ? std::nullopt : std::optional{median(std::move(values))};
    }

  private:
    static double median(std::vector<double> values) {
        std::sort(values.begin(), values.end());
        const auto middle = values.size() / 2;
        return rounded(values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2);
    }

    const std::vector<Figures>& passes_;
};

/// A ratio; 0 where there is nothing to divide by.
inline double over(double a, double b) { return b == 0 ? 0 : rounded(a / b); }

inline std::optional<double> over(std::optional<double> a, std::optional<double> b) {
    return a && b ? std::optional{over(*a, *b)} : std::nullopt;
}

} // namespace tool
