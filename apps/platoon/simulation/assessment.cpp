// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/assessment.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

// Values below these count as none, because a ratio of two of them would compare noise.
constexpr double least_error = 0.1;        // m
constexpr double least_speed = 0.1;        // m/s
constexpr double least_acceleration = 0.1; // m/s²
constexpr double least_amplitude = 0.001;  // of a sine, which is measured over many samples

constexpr double standing = 0.5; // m/s
constexpr double far_apart = 50; // m: more than a poor link adds to the distance, which others do not see

std::vector<double> ratios(const std::vector<double>& of_each, double least) {
    std::vector<double> out;
    for (std::size_t i = 1; i < of_each.size(); ++i) {
        out.push_back(of_each[i] < least ? NAN : of_each[i] / std::max(of_each[i - 1], least));
    }
    return out;
}

std::vector<double> amplitudes(const std::vector<std::complex<double>>& sums, std::size_t samples) {
    std::vector<double> out;
    out.reserve(sums.size());
    for (const auto& sum : sums) {
        out.push_back(2 * std::abs(sum) / static_cast<double>(samples));
    }
    return out;
}

void widen(std::vector<double>& most, const std::vector<double>& one) {
    most.resize(std::max(most.size(), one.size()), NAN);
    for (std::size_t i = 0; i < one.size(); ++i) {
        most[i] = std::fmax(most[i], one[i]);
    }
}

} // namespace

std::vector<double> spacing_errors(const std::vector<motion>& where, double spacing) {
    std::vector<double> errors;
    for (std::size_t i = 1; i < where.size(); ++i) {
        errors.push_back(where[i - 1].x - where[i].x - spacing);
    }
    return errors;
}

double least_gap(std::vector<placed> where) {
    std::sort(where.begin(), where.end(), [](const placed& a, const placed& b) { return a.x > b.x; });
    double least = NAN;
    for (std::size_t i = 1; i < where.size(); ++i) {
        least = std::fmin(least, where[i - 1].x - where[i - 1].length - where[i].x);
    }
    return least;
}

void widen(amplification& most, const amplification& one) {
    widen(most.error, one.error);
    widen(most.speed, one.speed);
    widen(most.acceleration, one.acceleration);
}

double largest(const std::vector<double>& gains_of_each) {
    double most = NAN;
    for (const double gain : gains_of_each) {
        most = std::fmax(most, gain);
    }
    return most;
}

assessment::assessment(std::size_t vehicles, double spacing, double length) : spacing_(spacing), length_(length) {
    result_.error.resize(vehicles - 1);
}

void assessment::sample(const std::vector<motion>& where) {
    sample(where, std::vector<double>(where.size(), spacing_));
}

void assessment::sample(const std::vector<motion>& where, const std::vector<double>& desired,
                        const std::vector<double>& lengths) {
    const bool complete = where.size() == result_.error.size() + 1;
    result_.string_ratio = complete ? 0 : result_.string_ratio;
    result_.stands = complete ? false : result_.stands;
    result_.apart = complete ? false : result_.apart;
    for (std::size_t i = 0; complete && i < where.size(); ++i) {
        auto& most = i == 0 ? of_leader_ : of_others_;
        most = std::max(most, std::abs(where[i].a));
        result_.stands = result_.stands || where[i].v < standing;
    }
    result_.acceleration_ratio = of_leader_ >= least_acceleration ? of_others_ / of_leader_ : NAN;
    for (std::size_t i = 0; i + 1 < where.size(); ++i) {
        const double distance = where[i].x - where[i + 1].x;
        const double gap = distance - (lengths.empty() ? length_ : lengths[i]);
        result_.least_gap = std::fmin(result_.least_gap, gap);
        if (const double closing = where[i + 1].v - where[i].v; closing > 0) {
            result_.least_time_to_collision = std::fmin(result_.least_time_to_collision, std::max(0.0, gap) / closing);
        }
        if (!complete) {
            continue;
        }
        auto& most = result_.error[i];
        most = std::max(most, std::abs(distance - desired[i + 1]));
        if (i > 0 && most >= least_error) {
            result_.string_ratio = std::max(result_.string_ratio, most / std::max(result_.error[i - 1], least_error));
        }
        result_.apart = result_.apart || distance - desired[i + 1] > far_apart;
    }
    if (complete) {
        (recovering_ ? recovery_ : braking_).add(where, desired);
    }
    if (complete && !result_.error.empty() && result_.error.front() >= least_error) {
        result_.first_ratio = *std::max_element(result_.error.begin(), result_.error.end()) / result_.error.front();
    }
    result_.collision = result_.least_gap <= 0;
}

void assessment::peaks::add(const std::vector<motion>& where, const std::vector<double>& desired) {
    if (initial_speed.empty()) {
        for (const auto& each : where) {
            initial_speed.push_back(each.v);
        }
        error.resize(where.size() - 1);
        speed.resize(where.size());
        acceleration.resize(where.size());
    }
    for (std::size_t i = 0; i < where.size(); ++i) {
        speed[i] = std::max(speed[i], std::abs(where[i].v - initial_speed[i]));
        acceleration[i] = std::max(acceleration[i], std::abs(where[i].a));
        if (i > 0) {
            error[i - 1] = std::max(error[i - 1], std::abs(where[i - 1].x - where[i].x - desired[i]));
        }
    }
}

amplification assessment::peaks::gains_of_each() const {
    return {.error = ratios(error, least_error),
            .speed = ratios(speed, least_speed),
            .acceleration = ratios(acceleration, least_acceleration)};
}

void assessment::correlate(double phase, const std::vector<motion>& where, const std::vector<double>& desired) {
    if (where.size() != result_.error.size() + 1) {
        return;
    }
    if (sine_.samples == 0) {
        for (const auto& each : where) {
            sine_.initial_speed.push_back(each.v);
        }
        sine_.error.resize(where.size() - 1);
        sine_.speed.resize(where.size());
        sine_.acceleration.resize(where.size());
    }
    const auto turn = std::polar(1.0, -phase);
    for (std::size_t i = 0; i < where.size(); ++i) {
        sine_.speed[i] += turn * (where[i].v - sine_.initial_speed[i]);
        sine_.acceleration[i] += turn * where[i].a;
        if (i > 0) {
            sine_.error[i - 1] += turn * (where[i - 1].x - where[i].x - desired[i]);
        }
    }
    ++sine_.samples;
}

verdict assessment::result() const {
    auto out = result_;
    out.braking = braking_.gains_of_each();
    out.recovery = recovery_.gains_of_each();
    if (sine_.samples > 0) {
        const auto gains_at = [this](const std::vector<std::complex<double>>& sums) {
            return ratios(amplitudes(sums, sine_.samples), least_amplitude);
        };
        out.sine = {.error = gains_at(sine_.error),
                    .speed = gains_at(sine_.speed),
                    .acceleration = gains_at(sine_.acceleration)};
    }
    return out;
}

} // namespace platoon
