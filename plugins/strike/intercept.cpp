// SPDX-License-Identifier: BSL-1.0
#include "intercept.hpp"

#include <cmath>

namespace strike {

// |d + v t| = s t, which is (v.v - s^2) t^2 + 2 d.v t + d.d = 0; the first t that is not negative.
std::optional<meeting> intercept(place from, double speed, place target, place velocity, double height) {
    const place d{target.x - from.x, target.y - from.y};
    const double a = velocity.x * velocity.x + velocity.y * velocity.y - speed * speed;
    const double half_b = d.x * velocity.x + d.y * velocity.y;
    const double c = d.x * d.x + d.y * d.y + height * height;
    double t = 0;
    if (c > 0) {
        if (std::abs(a) < 1e-12 * speed * speed) { // as fast as each other
            t = half_b < 0 ? -c / (2 * half_b) : -1;
        } else {
            const double root = half_b * half_b - a * c;
            if (root < 0) {
                return std::nullopt;
            }
            const double one = (-half_b - std::sqrt(root)) / a;
            const double two = (-half_b + std::sqrt(root)) / a;
            const double low = std::fmin(one, two);
            t = low >= 0 ? low : std::fmax(one, two);
        }
    }
    if (!(t >= 0) || !std::isfinite(t)) {
        return std::nullopt;
    }
    return meeting{.where = {target.x + velocity.x * t, target.y + velocity.y * t}, .after_s = t};
}

} // namespace strike
