// SPDX-License-Identifier: BSL-1.0
#include "federation/seen_numbers.hpp"

#include <algorithm>

namespace cles::bridging {

bool seen_numbers::add(std::uint64_t number) noexcept {
    if (highest_ >= window && number <= highest_ - window) {
        return false;
    }
    if (number > highest_) {
        const auto skipped = std::min<std::uint64_t>(number - highest_ - 1, window - 1);
        for (std::uint64_t back = 0; back <= skipped; ++back) {
            seen_.reset((number - back) % window);
        }
        highest_ = number;
    }
    const auto at = number % window;
    return seen_.test(at) ? false : (seen_.set(at), true);
}

} // namespace cles::bridging
