// SPDX-License-Identifier: BSL-1.0
#include "target_filter.hpp"

#include <cmath>
#include <cstddef>

namespace strike {
namespace {

constexpr double acceleration = 0.04; // spectral density, m²/s³

covariance inverse(const covariance& of) {
    const double determinant = of.ee * of.nn - of.en * of.en;
    return {.ee = of.nn / determinant, .en = -of.en / determinant, .nn = of.ee / determinant};
}

} // namespace

target_filter::target_filter(geo::plane_position at, geo::plane_position velocity, double sigma, double sigma_v)
    : x_{at.east, at.north, velocity.east, velocity.north} {
    p_[0][0] = p_[1][1] = sigma * sigma;
    p_[2][2] = p_[3][3] = sigma_v * sigma_v;
}

void target_filter::predict(double seconds) {
    const double t = seconds;
    for (std::size_t i = 0; i < 2; ++i) {
        x_[i] += x_[i + 2] * t;
    }
    // F P F', with F = 1 and t above the diagonal: first the rows, then the columns.
    for (std::size_t k = 0; k < 4; ++k) {
        p_[0][k] += p_[2][k] * t;
        p_[1][k] += p_[3][k] * t;
    }
    for (auto& row : p_) {
        row[0] += row[2] * t;
        row[1] += row[3] * t;
    }
    const double q = acceleration * std::abs(t);
    for (std::size_t i = 0; i < 2; ++i) {
        p_[i][i] += q * t * t / 3;
        p_[i][i + 2] += q * t / 2;
        p_[i + 2][i] += q * t / 2;
        p_[i + 2][i + 2] += q;
    }
}

covariance target_filter::innovation(const covariance& noise) const noexcept {
    return {.ee = p_[0][0] + noise.ee, .en = p_[0][1] + noise.en, .nn = p_[1][1] + noise.nn};
}

double target_filter::distance(geo::plane_position measured, const covariance& noise) const {
    const auto weight = inverse(innovation(noise));
    const double e = measured.east - x_[0];
    const double n = measured.north - x_[1];
    return weight.ee * e * e + 2 * weight.en * e * n + weight.nn * n * n;
}

void target_filter::correct(geo::plane_position measured, const covariance& noise) {
    const auto weight = inverse(innovation(noise));
    const double e = measured.east - x_[0];
    const double n = measured.north - x_[1];
    std::array<std::array<double, 2>, 4> gain{}; // P H' S^-1
    for (std::size_t i = 0; i < 4; ++i) {
        gain[i] = {p_[i][0] * weight.ee + p_[i][1] * weight.en, p_[i][0] * weight.en + p_[i][1] * weight.nn};
        x_[i] += gain[i][0] * e + gain[i][1] * n;
    }
    const auto first = p_[0];
    const auto second = p_[1];
    for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t k = 0; k < 4; ++k) {
            p_[i][k] -= gain[i][0] * first[k] + gain[i][1] * second[k];
        }
    }
}

double target_filter::deviation() const noexcept { return std::sqrt((p_[0][0] + p_[1][1]) / 2); }

} // namespace strike
