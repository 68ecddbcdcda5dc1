// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <deque>
#include <string>

namespace tool {

/// Minimum, mean, maximum and standard deviation of the newest values, at most `window` of them.
class statistics {
  public:
    explicit statistics(std::size_t window) : window_(window) {}

    void add(double value);

    [[nodiscard]] bool empty() const noexcept { return values_.empty(); }
    [[nodiscard]] std::size_t count() const noexcept { return values_.size(); }
    [[nodiscard]] double min() const;
    [[nodiscard]] double max() const;
    [[nodiscard]] double mean() const;
    [[nodiscard]] double standard_deviation() const;

  private:
    std::size_t window_;
    std::deque<double> values_;
};

/// With that many digits after the decimal point.
std::string fixed(double value, int digits);

/// Rounded to at most that many digits after the decimal point.
double rounded(double value, int digits);

} // namespace tool
