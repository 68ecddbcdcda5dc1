// SPDX-License-Identifier: BSL-1.0
#include "timed_sample.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

namespace cles::perf {
namespace {

constexpr double per_second = 1e6;

double now_us() noexcept {
    using std::chrono::microseconds;
    const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
    return static_cast<double>(std::chrono::duration_cast<microseconds>(since_1970).count());
}

} // namespace

localization timed_sample(std::uint64_t n) noexcept {
    auto value = sample(n);
    value.utc = now_us() / per_second;
    return value;
}

double age_of(const localization& value) {
    // The samples' velocity grows with their number.
    const auto& first = sample(0);
    const double step = sample(1).velocity - first.velocity;
    auto wanted =
        sample(static_cast<std::uint64_t>(std::max(0L, std::lround((value.velocity - first.velocity) / step))));
    wanted.utc = value.utc;
    if (value != wanted) {
        throw std::runtime_error("the received values are not those that were sent");
    }
    return now_us() - std::round(value.utc * per_second);
}

} // namespace cles::perf
