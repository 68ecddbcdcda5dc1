// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "localization.hpp"

#include <boost/describe/class.hpp>

#include <chrono>
#include <cstdint>

namespace cles::perf {

/// The localization packet with the time at which it was published: what is timed on its way to many.
///
/// Both ends read the host's one monotonic clock, so that the time of one way is known exactly.
struct publication : localization {
    std::int64_t published_ns = 0;
};
BOOST_DESCRIBE_STRUCT(publication, (localization), (published_ns))

inline std::int64_t monotonic_ns() noexcept {
    return std::chrono::nanoseconds{std::chrono::steady_clock::now().time_since_epoch()}.count();
}

/// The values in turn, published now.
inline publication publish_sample(std::uint64_t n) noexcept {
    publication value;
    static_cast<localization&>(value) = sample(n);
    value.published_ns = monotonic_ns();
    return value;
}

} // namespace cles::perf
