// SPDX-License-Identifier: BSL-1.0
#include "latency_recorder.hpp"

#include <algorithm>
#include <cmath>

namespace cles::perf {

double median(std::vector<double> of) {
    const auto middle = of.begin() + static_cast<std::ptrdiff_t>(of.size() / 2);
    std::nth_element(of.begin(), middle, of.end());
    return *middle;
}

void latency_recorder::copy_to(latency_recorder& other) const noexcept {
    const auto count = std::min(count_, other.remaining());
    std::copy_n(nanoseconds_.begin(), count, other.nanoseconds_.begin() + static_cast<std::ptrdiff_t>(other.count_));
    other.count_ += count;
}

latencies latency_recorder::quantiles() {
    if (count_ == 0) {
        return {};
    }
    const auto begin = nanoseconds_.begin();
    const auto end = begin + static_cast<std::ptrdiff_t>(count_);
    // The nearest rank: the smallest latency that this share of all does not exceed.
    const auto quantile = [&](double share) {
        const auto rank = std::ceil(share * static_cast<double>(count_));
        const auto at = begin + std::max<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(rank) - 1, 0);
        std::nth_element(begin, at, end);
        return static_cast<double>(*at) / 1e3;
    };
    return {.p50 = quantile(0.5), .p99 = quantile(0.99), .p999 = quantile(0.999), .max = quantile(1)};
}

} // namespace cles::perf
