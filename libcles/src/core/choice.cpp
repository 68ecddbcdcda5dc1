// SPDX-License-Identifier: BSL-1.0
#include "core/choice.hpp"

#include <algorithm>

namespace cles::core {

bool is_better(const candidate& a, const candidate& b) noexcept {
    // The work that is there, one more with it, shared among the workers; as long as one piece takes, where both say.
    const auto share = [](const candidate& c) {
        return static_cast<double>(c.ahead() + 1) / static_cast<double>(std::max<std::uint32_t>(c.load.workers, 1));
    };
    const bool timed = a.load.service_us != 0 && b.load.service_us != 0;
    const auto wait_a = share(a) * (timed ? a.load.service_us : 1);
    const auto wait_b = share(b) * (timed ? b.load.service_us : 1);
    return wait_a < wait_b;
}

std::uint32_t choice::below(std::uint32_t bound) noexcept {
    state_ ^= state_ << 13U; // xorshift32 (Marsaglia 2003)
    state_ ^= state_ >> 17U;
    state_ ^= state_ << 5U;
    return static_cast<std::uint32_t>((std::uint64_t{state_} * bound) >> 32U); // Lemire 2019, without the last fairness
}

candidate* choice::of(std::span<candidate* const> all) noexcept {
    const auto count = static_cast<std::uint32_t>(all.size());
    if (count < 2) {
        return count == 0 ? nullptr : all.front();
    }
    const auto first = below(count);
    auto second = below(count - 1);
    second += second >= first ? 1 : 0;
    return is_better(*all[second], *all[first]) ? all[second] : all[first];
}

} // namespace cles::core
