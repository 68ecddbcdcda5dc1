// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include "options.hpp"
#include "perf/support/latency_recorder.hpp"

#include <boost/describe/class.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// How measured values are summarised and reported.
namespace tool {

inline double microseconds(std::chrono::nanoseconds span) { return static_cast<double>(span.count()) / 1e3; }

/// To three decimals, which is as precise as the measurements are.
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

/// A ratio; 0 if the divisor is 0.
inline double over(double a, double b) { return b == 0 ? 0 : rounded(a / b); }

inline std::optional<double> over(std::optional<double> a, std::optional<double> b) {
    return a && b ? std::optional{over(*a, *b)} : std::nullopt;
}

struct latency_figures {
    double p50_us = 0;
    double p99_us = 0;
    double p999_us = 0;
    double max_us = 0;
};
BOOST_DESCRIBE_STRUCT(latency_figures, (), (p50_us, p99_us, p999_us, max_us))

latency_figures to_figures(const cles::perf::latencies& found);
latency_figures median_of(const std::vector<latency_figures>& passes);

/// A report as the options ask for. `table_of` is found by the report's type.
template <class Report>
std::string text_of(const Report& report, const bench_options& options) {
    return options.as_json ? cles::to_json(report) + "\n" : table_of(report);
}

} // namespace tool
