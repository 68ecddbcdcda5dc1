// SPDX-License-Identifier: BSL-1.0
#include "node/routing/power_of_two_choices.hpp"

#include <algorithm>

namespace cles::core {

bool is_better(const candidate& a, const candidate& b) noexcept {
    // The work there, including one more, per worker; times the service time if both report it.
    const auto share = [](const candidate& c) {
        return static_cast<double>(c.estimated_work() + 1) /
               static_cast<double>(std::max<std::uint32_t>(c.load.workers, 1));
    };
    const bool timed = a.load.service_us != 0 && b.load.service_us != 0;
    const auto wait_a = share(a) * (timed ? a.load.service_us : 1);
    const auto wait_b = share(b) * (timed ? b.load.service_us : 1);
    return wait_a < wait_b;
}

candidate* power_of_two_choices::select(std::span<candidate* const> all) noexcept {
    const auto count = all.size();
    if (count < 2) {
        return count == 0 ? nullptr : all.front();
    }
    const auto first = draws_.below(count);
    auto second = draws_.below(count - 1);
    second += second >= first ? 1 : 0;
    return is_better(*all[second], *all[first]) ? all[second] : all[first];
}

} // namespace cles::core
