// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <chrono>
#include <ratio>

namespace cles::core {

/// The point in time so much after (or before) another: the last or first one there is, where it would lie beyond that.
/// What is added comes from an option, a peer or a plugin wherever it is no constant, and may be anything.
template <class Rep, class Period>
[[nodiscard]] constexpr time_point later(time_point from, std::chrono::duration<Rep, Period> by) noexcept {
    using coarse = std::chrono::duration<double, std::ratio<3600>>; // compares without overflow
    using exact = time_point::duration;
    if (by >= decltype(by)::zero()) {
        const auto left = exact::max() - std::max(from.time_since_epoch(), exact::zero());
        return coarse{by} >= coarse{left} ? time_point::max() : from + std::chrono::duration_cast<exact>(by);
    }
    const auto left = exact::min() - std::min(from.time_since_epoch(), exact::zero());
    return coarse{by} <= coarse{left} ? time_point::min() : from + std::chrono::duration_cast<exact>(by);
}

} // namespace cles::core
