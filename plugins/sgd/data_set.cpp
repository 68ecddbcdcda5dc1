// SPDX-License-Identifier: BSL-1.0
#include "data_set.hpp"

#include "random_source.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <stdexcept>

namespace sgd {
namespace {

// Two independent numbers of a normal distribution (Marsaglia's polar method); the standard library's are another's
// with another library.
point normal(random_source& chance) {
    for (;;) {
        const auto u = chance.within_one();
        const auto v = chance.within_one();
        const auto s = u * u + v * v;
        if (s > 0 && s < 1) {
            const auto scale = std::sqrt(-2 * std::log(s) / s);
            return {u * scale, v * scale};
        }
    }
}

} // namespace

std::string to_string(const recipe& r) {
    std::array<char, 32> apart{};
    std::snprintf(apart.data(), apart.size(), "%g", r.separation);
    return std::to_string(r.per_class) + " points per class, " + apart.data() + " apart, from seed " +
           std::to_string(r.seed);
}

data_set::data_set(const recipe& from) : recipe_(from) {
    if (from.per_class == 0 || from.per_class > most_per_class) {
        throw std::invalid_argument("per_class: " + std::to_string(from.per_class) + ": 1 to " +
                                    std::to_string(most_per_class));
    }
    random_source chance{from.seed};
    // The means lie on the diagonal, as far from the origin on either side.
    const auto mean = from.separation / 2 / std::numbers::sqrt2;
    points_.reserve(2 * from.per_class);
    for (std::uint64_t i = 0; i < 2 * from.per_class; ++i) {
        const auto centre = i % 2 == 0 ? -mean : mean;
        const auto [x, y] = normal(chance);
        points_.push_back({centre + x, centre + y});
    }
}

} // namespace sgd
