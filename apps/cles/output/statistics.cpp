// SPDX-License-Identifier: BSL-1.0
#include "output/statistics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

namespace tool {

void statistics::add(double value) {
    if (values_.size() == window_) {
        values_.pop_front();
    }
    values_.push_back(value);
}

double statistics::min() const { return *std::min_element(values_.begin(), values_.end()); }

double statistics::max() const { return *std::max_element(values_.begin(), values_.end()); }

double statistics::mean() const {
    return std::accumulate(values_.begin(), values_.end(), 0.0) / static_cast<double>(values_.size());
}

double statistics::standard_deviation() const {
    const double average = mean();
    double sum = 0;
    for (const double value : values_) {
        sum += (value - average) * (value - average);
    }
    return std::sqrt(sum / static_cast<double>(values_.size()));
}

std::string fixed(double value, int digits) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%.*f", digits, value);
    return text.data();
}

double rounded(double value, int digits) {
    const double scale = std::pow(10.0, digits);
    return std::round(value * scale) / scale;
}

} // namespace tool
