// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/assessment.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

// Below these, a ratio would compare noise.
constexpr double least_error = 0.01;       // m
constexpr double least_acceleration = 0.1; // m/s²

} // namespace

std::vector<double> spacing_errors(const std::vector<motion>& where, double spacing) {
    std::vector<double> errors;
    for (std::size_t i = 1; i < where.size(); ++i) {
        errors.push_back(where[i - 1].x - where[i].x - spacing);
    }
    return errors;
}

double least_gap(std::vector<motion> where, double length) {
    std::sort(where.begin(), where.end(), [](const motion& a, const motion& b) { return a.x > b.x; });
    double least = NAN;
    for (std::size_t i = 1; i < where.size(); ++i) {
        least = std::fmin(least, where[i - 1].x - where[i].x - length);
    }
    return least;
}

assessment::assessment(std::size_t vehicles, double spacing, double length) : spacing_(spacing), length_(length) {
    result_.error.resize(vehicles - 1);
}

void assessment::sample(const std::vector<motion>& where) {
    sample(where, std::vector<double>(where.size(), spacing_));
}

void assessment::sample(const std::vector<motion>& where, const std::vector<double>& desired) {
    const bool complete = where.size() == result_.error.size() + 1;
    result_.string_ratio = complete ? 0 : result_.string_ratio;
    for (std::size_t i = 0; complete && i < where.size(); ++i) {
        auto& most = i == 0 ? of_leader_ : of_others_;
        most = std::max(most, std::abs(where[i].a));
    }
    result_.acceleration_ratio = of_leader_ >= least_acceleration ? of_others_ / of_leader_ : NAN;
    for (std::size_t i = 0; i + 1 < where.size(); ++i) {
        const double distance = where[i].x - where[i + 1].x;
        result_.least_gap = std::fmin(result_.least_gap, distance - length_);
        if (!complete) {
            continue;
        }
        auto& most = result_.error[i];
        most = std::max(most, std::abs(distance - desired[i + 1]));
        if (i > 0 && result_.error[i - 1] > 0) {
            result_.string_ratio = std::max(result_.string_ratio, most / result_.error[i - 1]);
        }
    }
    if (complete && !result_.error.empty() && result_.error.front() >= least_error) {
        result_.first_ratio = *std::max_element(result_.error.begin(), result_.error.end()) / result_.error.front();
    }
    result_.collision = result_.least_gap <= 0;
}

} // namespace platoon
