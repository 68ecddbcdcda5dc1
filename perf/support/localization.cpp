// SPDX-License-Identifier: BSL-1.0
#include "localization.hpp"

#include <array>
#include <cmath>
#include <cstddef>

namespace cles::perf {
namespace {

constexpr std::size_t sample_count = 64;
constexpr double first_utc = 1'700'000'000;

double rounded(double value, double steps) { return std::round(value * steps) / steps; }

using all_samples = std::array<localization, sample_count>;

all_samples make_samples() {
    all_samples samples;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const auto at = static_cast<double>(i);
        samples[i] = {.utc = rounded(first_utc + at / 1000 + 0.5, 1e3),
                      .lat = rounded(48.137154 + 0.000271 * std::sin(at), 1e6),
                      .lon = rounded(11.576124 + 0.000271 * std::cos(at), 1e6),
                      .velocity = rounded(27.31 + at / 50, 1e3),
                      .acceleration = rounded(0.12 - at / 400, 1e3)};
    }
    return samples;
}

// Sensors and filters compute values with all digits: the steps are fractions that no short decimal number has.
all_samples make_unrounded_samples() {
    all_samples samples;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const auto at = static_cast<double>(i);
        samples[i] = {.utc = first_utc + 0.5 + at / 997,
                      .lat = 48.137154 + 0.000271 * std::sin(at + 1),
                      .lon = 11.576124 + 0.000271 * std::cos(at + 1),
                      .velocity = 27.31 + (at + 1) / 53,
                      .acceleration = 0.12 - (at + 1) / 397};
    }
    return samples;
}

const all_samples samples = make_samples();
const all_samples unrounded_samples = make_unrounded_samples();

} // namespace

const localization& sample(std::uint64_t n) noexcept { return samples[n % sample_count]; }

const localization& unrounded_sample(std::uint64_t n) noexcept { return unrounded_samples[n % sample_count]; }

bool is_sample(const localization& value) noexcept {
    const double milliseconds = (value.utc - samples[0].utc) * 1000 + 0.5;
    return milliseconds >= 0 && milliseconds < static_cast<double>(sample_count) &&
           value == samples[static_cast<std::size_t>(milliseconds)];
}

} // namespace cles::perf
