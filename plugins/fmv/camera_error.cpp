// SPDX-License-Identifier: BSL-1.0
#include "camera_error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace fmv {
namespace {

constexpr std::size_t half_side = 30;
constexpr std::size_t side = 2 * half_side + 1; // squares of the grid, in each direction
constexpr double reach = 4;                     // standard deviations to its edge
constexpr double remembered = 0.95;             // of all that was seen, from scan to scan
constexpr double least_evidence = 4.6;          // a hundred to one
constexpr double most_evidence = 20;            // so that it changes soon if the plots do
constexpr double beyond = 5;                    // standard deviations from which a plot says nothing
constexpr double least_known = 0.5;             // m: the map moves by as much

using weights = std::array<double, side>;

double square(double value) { return value * value; }

} // namespace

camera_error::camera_error(double deviation)
    : axis_(side), prior_(side * side), ratio_(side * side), deviation_(std::max(deviation, least_known)) {
    step_ = reach * deviation_ / static_cast<double>(half_side);
    for (std::size_t i = 0; i < side; ++i) {
        axis_[i] = (static_cast<double>(i) - static_cast<double>(half_side)) * step_;
    }
    for (std::size_t i = 0; i < side; ++i) {
        for (std::size_t k = 0; k < side; ++k) {
            prior_[i * side + k] = -(square(axis_[i]) + square(axis_[k])) / (2 * square(deviation_));
        }
    }
    belief_ = prior_;
    normalise();
    prior_ = belief_;
}

bool camera_error::is_known() const noexcept { return evidence_ > least_evidence; }

void camera_error::observe(const std::vector<geo::plane_position>& places,
                           const std::vector<geo::plane_position>& plots, const plot_statistics& of_plots) {
    // On a grid that is coarse for the plots, it would seem better known than it is.
    if (places.empty() || step_ > of_plots.deviation / 2) {
        return;
    }
    forget();
    for (const auto& place : places) {
        weigh(place, plots, of_plots);
    }
    evidence_ = std::clamp(evidence_ + normalise(), -most_evidence, most_evidence);
    summarise();
}

// The weight of what was seen decreases; that of what was assumed at first remains.
void camera_error::forget() {
    for (std::size_t i = 0; i < belief_.size(); ++i) {
        belief_[i] = remembered * belief_[i] + (1 - remembered) * prior_[i];
    }
    normalise();
}

// Multiplies by the probability of the plots if the target is there, divided by that if there is none.
void camera_error::weigh(const geo::plane_position& place, const std::vector<geo::plane_position>& plots,
                         const plot_statistics& of_plots) {
    const double variance = square(of_plots.deviation);
    const double height = of_plots.detected / (of_plots.others * 2 * std::numbers::pi * variance);
    const double farthest = -axis_.front() + beyond * of_plots.deviation;
    std::fill(ratio_.begin(), ratio_.end(), 1 - of_plots.detected);
    for (const auto& plot : plots) {
        const geo::plane_position off{.east = place.east - plot.east, .north = place.north - plot.north};
        if (std::abs(off.east) > farthest || std::abs(off.north) > farthest) {
            continue;
        }
        weights to_east{};
        weights to_north{};
        for (std::size_t i = 0; i < side; ++i) {
            to_east[i] = height * std::exp(-square(off.east - axis_[i]) / (2 * variance));
            to_north[i] = std::exp(-square(off.north - axis_[i]) / (2 * variance));
        }
        for (std::size_t i = 0; i < side; ++i) {
            for (std::size_t k = 0; k < side; ++k) {
                ratio_[i * side + k] += to_east[i] * to_north[k];
            }
        }
    }
    for (std::size_t i = 0; i < belief_.size(); ++i) {
        belief_[i] += std::log(ratio_[i]);
    }
}

// Makes the sum of all probabilities one. Returns the logarithm of what it was.
double camera_error::normalise() {
    const double most = *std::max_element(belief_.begin(), belief_.end());
    double sum = 0;
    for (const double each : belief_) {
        sum += std::exp(each - most);
    }
    const double total = most + std::log(sum);
    for (double& each : belief_) {
        each -= total;
    }
    return total;
}

void camera_error::summarise() {
    mean_ = {};
    double squares = 0;
    for (std::size_t i = 0; i < side; ++i) {
        for (std::size_t k = 0; k < side; ++k) {
            const double probability = std::exp(belief_[i * side + k]);
            mean_.east += probability * axis_[i];
            mean_.north += probability * axis_[k];
            squares += probability * (square(axis_[i]) + square(axis_[k]));
        }
    }
    const double variance = (squares - square(mean_.east) - square(mean_.north)) / 2;
    deviation_ = std::sqrt(std::max(variance, 0.0) + square(least_known));
}

} // namespace fmv
